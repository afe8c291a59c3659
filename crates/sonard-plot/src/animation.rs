//! Animated PNG from a sequence of pictures.

use resvg::tiny_skia;

use super::{PlotError, picture::Picture};

/// Encodes pictures as an endless animation; each is shown for `frame_ms`, the last ten times as
/// long.
///
/// All frames have the height of the tallest picture: legends whose texts change may wrap to
/// another number of lines.
///
/// # Errors
/// No picture, a size out of bounds, or a failure of rendering or encoding.
pub fn animate(
    frames: impl IntoIterator<Item = Picture>,
    width_px: u32,
    frame_ms: u16,
) -> Result<Vec<u8>, PlotError> {
    let encoding = |error: png::EncodingError| PlotError::Encoding(error.to_string());
    let frames: Vec<Picture> = frames.into_iter().collect();
    let tallest = frames.iter().max_by(|a, b| a.aspect().total_cmp(&b.aspect()));
    let tallest = tallest.ok_or_else(|| PlotError::Encoding("no picture".to_owned()))?;
    let mut pixels = tallest.to_pixels(width_px)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width_px, pixels.height());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_animated(frames.len().try_into().unwrap_or(u32::MAX), 0).map_err(encoding)?;
    encoder.set_frame_delay(frame_ms, 1000).map_err(encoding)?;
    let mut writer = encoder.write_header().map_err(encoding)?;
    for (number, frame) in frames.iter().enumerate() {
        if number > 0 && number + 1 == frames.len() {
            writer.set_frame_delay(frame_ms.saturating_mul(10), 1000).map_err(encoding)?;
        }
        pixels.fill(tiny_skia::Color::WHITE);
        frame.draw_onto(&mut pixels)?;
        // The page is opaque, so premultiplied colours equal straight ones.
        writer.write_image_data(pixels.data()).map_err(encoding)?;
    }
    writer.finish().map_err(encoding)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canvas::Layer;

    #[test]
    fn frames_of_different_heights() {
        let heights = [40.0, 60.0, 50.0];
        let frames = heights.map(|height_px| Picture::new(100.0, height_px, Layer::new("frame")));
        let bytes = animate(frames, 50, 100).expect("an animation");
        let mut decoder =
            png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a header");
        let info = decoder.info();
        assert_eq!((info.width, info.height), (50, 30), "the tallest frame");
        assert_eq!(info.animation_control().map(|control| control.num_frames), Some(3));
        let mut pixels = vec![0; decoder.output_buffer_size().expect("a size")];
        for _ in heights {
            decoder.next_frame(&mut pixels).expect("a frame");
            assert!(pixels.iter().all(|&byte| byte == 255), "white paper to the border");
        }
    }
}
