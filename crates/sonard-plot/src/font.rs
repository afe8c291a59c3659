//! Metrics of the bundled font, in which all pictures are laid out.

use std::sync::LazyLock;

use skrifa::{
    FontRef, MetadataProvider as _,
    instance::{LocationRef, Size},
};

/// Width of characters that the font lacks, em; viewers take them from another font.
const MISSING_EM: f64 = 0.6;

/// Widths of the characters up to this one are looked up once.
const CACHED: u32 = 0x2300;

/// Advance widths of the bundled font, em, by character.
static WIDTHS: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let Ok(font) = FontRef::new(epaint_default_fonts::UBUNTU_LIGHT) else { return Vec::new() };
    let metrics = font.glyph_metrics(Size::unscaled(), LocationRef::default());
    let units_per_em =
        f32::from(font.metrics(Size::unscaled(), LocationRef::default()).units_per_em);
    let charmap = font.charmap();
    let width = |character: u32| {
        let advance = charmap.map(character).and_then(|glyph| metrics.advance_width(glyph));
        advance.map_or(MISSING_EM as f32, |advance| advance / units_per_em)
    };
    (0..CACHED).map(width).collect()
});

/// Advance width of a character in the bundled font, em.
pub(super) fn advance_em(character: char) -> f64 {
    WIDTHS.get(character as usize).map_or(MISSING_EM, |width| f64::from(*width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_of_letters() {
        let [i, m, digit] = ['i', 'm', '0'].map(advance_em);
        assert!(i < 0.3 && m > 0.8 && (0.5..0.6).contains(&digit), "{i} {m} {digit}");
        assert!("0123456789".chars().all(|c| advance_em(c) == digit), "figures have one width");
        assert_eq!(advance_em('\u{4e00}'), MISSING_EM);
    }
}
