//! Pictures one after the other as one animated PNG, which browsers play.

use super::{PlotError, picture::Picture};

/// `count` pictures of one size as an animation without end, each shown for `frame_ms` and the last
/// for ten times that.
///
/// # Errors
/// When there is no picture, their sizes differ, or the image can't be made or encoded.
pub fn animate(
    frames: impl IntoIterator<Item = Picture>,
    count: usize,
    width_px: u32,
    frame_ms: u16,
) -> Result<Vec<u8>, PlotError> {
    let refuse = |error: png::EncodingError| PlotError::Encoding(error.to_string());
    let mut frames = frames.into_iter();
    let first = frames.next().ok_or_else(|| PlotError::Encoding("no picture".to_owned()))?;
    let first = first.to_pixels(width_px)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width_px, first.height());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_animated(count.try_into().unwrap_or(u32::MAX), 0).map_err(refuse)?;
    encoder.set_frame_delay(frame_ms, 1000).map_err(refuse)?;
    let mut writer = encoder.write_header().map_err(refuse)?;
    // The page is opaque, so that premultiplied colours are the plain ones.
    writer.write_image_data(first.data()).map_err(refuse)?;
    for (number, frame) in frames.enumerate() {
        if number + 2 == count {
            writer.set_frame_delay(frame_ms.saturating_mul(10), 1000).map_err(refuse)?;
        }
        writer.write_image_data(frame.to_pixels(width_px)?.data()).map_err(refuse)?;
    }
    writer.finish().map_err(refuse)?;
    Ok(bytes)
}
