//! Any bytes as the description and the image of a map: nothing panics, and memory follows the
//! bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sonard::interpret::grid::{MapYaml, from_pgm};

fuzz_target!(|bytes: &[u8]| {
    let at = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (text, image) = bytes.split_at(at);
    let image = image.get(1..).unwrap_or_default();
    let by_text = MapYaml::from_text(&String::from_utf8_lossy(text)).ok();
    let plain = "image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n";
    for yaml in [by_text, MapYaml::from_text(plain).ok()].into_iter().flatten() {
        if let Ok(grid) = from_pgm(image, &yaml) {
            assert!(grid.probabilities().all(|p| (0.0..=1.0).contains(&p)));
        }
    }
});
