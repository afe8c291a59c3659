//! Animated PNG from a sequence of pictures.

use super::{PlotError, picture::Picture};

/// Encodes `count` pictures of one size as an endless animation; each is shown for `frame_ms`, the
/// last ten times as long.
///
/// # Errors
/// No picture, different sizes, or a failure of rendering or encoding.
pub fn animate(
    frames: impl IntoIterator<Item = Picture>,
    count: usize,
    width_px: u32,
    frame_ms: u16,
) -> Result<Vec<u8>, PlotError> {
    let encoding = |error: png::EncodingError| PlotError::Encoding(error.to_string());
    let mut frames = frames.into_iter();
    let first = frames.next().ok_or_else(|| PlotError::Encoding("no picture".to_owned()))?;
    let first = first.to_pixels(width_px)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width_px, first.height());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_animated(count.try_into().unwrap_or(u32::MAX), 0).map_err(encoding)?;
    encoder.set_frame_delay(frame_ms, 1000).map_err(encoding)?;
    let mut writer = encoder.write_header().map_err(encoding)?;
    // The page is opaque, so premultiplied colours equal straight ones.
    writer.write_image_data(first.data()).map_err(encoding)?;
    for (number, frame) in frames.enumerate() {
        if number + 2 == count {
            writer.set_frame_delay(frame_ms.saturating_mul(10), 1000).map_err(encoding)?;
        }
        writer.write_image_data(frame.to_pixels(width_px)?.data()).map_err(encoding)?;
    }
    writer.finish().map_err(encoding)?;
    Ok(bytes)
}
