//! Pictures joined to one that moves.

use std::{
    collections::HashMap,
    fs::File,
    io::{BufWriter, Cursor},
    path::Path,
};

use png::{BitDepth, BlendOp, ColorType, Decoder, DisposeOp, Encoder, Transformations};

type Colour = [u8; 3];

/// Colours of the picture; the one after them is that of the frame before.
const COLOURS: usize = 255;

/// Writes PNGs of one size as an animated PNG that begins anew for ever: each with how long it stands, milliseconds.
/// It has the colours that are used most, and of each frame after the first what differs from the one before.
pub(super) fn write(file: &Path, frames: &[(Vec<u8>, u16)]) {
    let pictures: Vec<([u32; 2], Vec<Colour>)> =
        frames.iter().map(|(png, _)| decode(png)).collect();
    let [width, height] = pictures[0].0;
    let palette = palette(&pictures);
    let mut nearest = HashMap::new();
    let mut indices: Vec<Vec<u8>> = Vec::new();
    for (size, picture) in &pictures {
        assert_eq!(*size, [width, height], "all frames are of one size");
        let index = |colour| *nearest.entry(colour).or_insert_with(|| place(&palette, colour));
        indices.push(picture.iter().copied().map(index).collect());
    }
    let out = BufWriter::new(File::create(file).expect("there is room"));
    let mut encoder = Encoder::new(out, width, height);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    let mut colours: Vec<u8> = palette.iter().flatten().copied().collect();
    colours.resize(3 * (COLOURS + 1), 0);
    encoder.set_palette(colours);
    let mut alpha = vec![255; COLOURS];
    alpha.push(0);
    encoder.set_trns(alpha);
    encoder.set_animated(frames.len() as u32, 0).expect("frames");
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().expect("a file");
    writer.set_dispose_op(DisposeOp::None).expect("animated");
    for (at, (_, stands_ms)) in frames.iter().enumerate() {
        writer.set_frame_delay(*stands_ms, 1000).expect("animated");
        writer
            .set_blend_op(if at == 0 { BlendOp::Source } else { BlendOp::Over })
            .expect("animated");
        let before = at.checked_sub(1).map(|before| &indices[before]);
        let changed = |(place, index): (usize, &u8)| match before {
            Some(before) if before[place] == *index => COLOURS as u8,
            _ => *index,
        };
        let data: Vec<u8> = indices[at].iter().enumerate().map(changed).collect();
        writer.write_image_data(&data).expect("there is room");
    }
    writer.finish().expect("there is room");
}

fn decode(png: &[u8]) -> ([u32; 2], Vec<Colour>) {
    let mut decoder = Decoder::new(Cursor::new(png));
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut bytes).expect("its picture");
    let samples = info.color_type.samples();
    assert!(samples >= 3, "a picture of a page has colours");
    let colours = bytes.chunks_exact(samples).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    ([info.width, info.height], colours.collect())
}

/// The colours that are used most.
fn palette(pictures: &[([u32; 2], Vec<Colour>)]) -> Vec<Colour> {
    let mut counts: HashMap<Colour, usize> = HashMap::new();
    for colour in pictures.iter().flat_map(|(_, picture)| picture) {
        *counts.entry(*colour).or_default() += 1;
    }
    let mut colours: Vec<(usize, Colour)> =
        counts.into_iter().map(|(colour, count)| (count, colour)).collect();
    colours.sort_unstable_by(|one, other| other.cmp(one));
    colours.truncate(COLOURS);
    colours.into_iter().map(|(_, colour)| colour).collect()
}

/// Of the colour that is nearest.
fn place(palette: &[Colour], colour: Colour) -> u8 {
    let off = |other: &Colour| -> u32 {
        other.iter().zip(colour).map(|(one, other)| u32::from(one.abs_diff(other)).pow(2)).sum()
    };
    let nearest = palette.iter().enumerate().min_by_key(|(_, other)| off(other));
    nearest.map_or(0, |(at, _)| at as u8)
}
