//! Animated PNG from a series of pictures.

use std::{
    collections::HashMap,
    fs::File,
    io::{BufWriter, Cursor},
    path::Path,
};

use png::{BitDepth, BlendOp, ColorType, Decoder, DisposeOp, Encoder, Transformations};

type Colour = [u8; 3];

/// Size of the palette; the entry after it is transparent and keeps the previous frame's pixel.
const COLOURS: usize = 255;

/// Writes PNGs of equal size, each with its duration in milliseconds, as an endless animated PNG.
/// The palette contains the most frequent colours; each frame after the first stores only changed
/// pixels.
pub(super) fn write(file: &Path, frames: &[(Vec<u8>, u16)]) {
    let pictures: Vec<([u32; 2], Vec<Colour>)> =
        frames.iter().map(|(png, _)| decode(png)).collect();
    let [width, height] = pictures[0].0;
    let palette = palette(&pictures);
    let mut nearest = HashMap::new();
    let mut indices: Vec<Vec<u8>> = Vec::new();
    for (size, picture) in &pictures {
        assert_eq!(*size, [width, height], "all frames are of one size");
        let index =
            |colour| *nearest.entry(colour).or_insert_with(|| nearest_index(&palette, colour));
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
    for (at, (_, duration_ms)) in frames.iter().enumerate() {
        writer.set_frame_delay(*duration_ms, 1000).expect("animated");
        writer
            .set_blend_op(if at == 0 { BlendOp::Source } else { BlendOp::Over })
            .expect("animated");
        let previous = at.checked_sub(1).map(|previous| &indices[previous]);
        let changed = |(position, index): (usize, &u8)| match previous {
            Some(previous) if previous[position] == *index => COLOURS as u8,
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
    assert!(samples >= 3, "a screenshot has colours");
    let colours = bytes.chunks_exact(samples).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    ([info.width, info.height], colours.collect())
}

/// Most frequent colours.
fn palette(pictures: &[([u32; 2], Vec<Colour>)]) -> Vec<Colour> {
    let mut counts: HashMap<Colour, usize> = HashMap::new();
    for colour in pictures.iter().flat_map(|(_, picture)| picture) {
        *counts.entry(*colour).or_default() += 1;
    }
    let mut colours: Vec<(usize, Colour)> =
        counts.into_iter().map(|(colour, count)| (count, colour)).collect();
    colours.sort_unstable_by(|a, b| b.cmp(a));
    colours.truncate(COLOURS);
    colours.into_iter().map(|(_, colour)| colour).collect()
}

/// Index of the nearest colour of the palette.
fn nearest_index(palette: &[Colour], colour: Colour) -> u8 {
    let distance = |entry: &Colour| -> u32 {
        entry.iter().zip(colour).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
    };
    let nearest = palette.iter().enumerate().min_by_key(|(_, entry)| distance(entry));
    nearest.map_or(0, |(at, _)| at as u8)
}
