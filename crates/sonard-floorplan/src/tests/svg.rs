//! Drawings as SVG.

use super::walls;
use crate::{
    FloorPlan, PlanError,
    svg::{self, SvgOptions},
};

fn drawing(text: &str) -> Result<FloorPlan, PlanError> {
    svg::read(text.as_bytes(), &SvgOptions { width_m: 10.0 })
}

fn page(content: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 80' stroke='black'>{content}</svg>"
    )
}

const LINE: &str = "<line x1='0' y1='40' x2='100' y2='40'/>";

#[test]
fn accepts_a_document_type() {
    for head in [
        "<!DOCTYPE svg PUBLIC '-//W3C//DTD SVG 1.1//EN' 'http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd'>",
        "<?xml version='1.0'?><!DOCTYPE svg [<!ENTITY ns 'http://www.w3.org/2000/svg'>]>",
    ] {
        let plan = drawing(&format!("{head}{}", page(LINE))).expect("a drawing");
        assert_eq!(walls(&plan), [[0.0, 4.0, 10.0, 4.0]]);
    }
}

#[test]
fn filters_and_pages() {
    let shadow =
        format!("<filter id='f'><feOffset dx='50'/></filter><g filter='url(#f)'>{LINE}</g>");
    assert_eq!(walls(&drawing(&page(&shadow)).expect("a drawing")), [[0.0, 4.0, 10.0, 4.0]]);
    let beyond = drawing(&page("<line x1='-50' y1='40' x2='150' y2='40'/>")).expect("a drawing");
    assert!(beyond.notes[0].contains("1 lines reach beyond the page"), "{:?}", beyond.notes);
}

#[test]
fn clip_paths_of_any_shape() {
    for (clip, spans) in [
        ("<polygon points='20,0 60,0 60,80 40,80'/>", vec![[3.0, 6.0]]),
        (
            "<rect x='40' y='0' width='20' height='80' transform='rotate(45 50 40)'/>",
            vec![[3.586, 6.414]],
        ),
        (
            "<rect x='10' width='20' height='80'/><rect x='60' width='20' height='80'/>",
            vec![[1.0, 3.0], [6.0, 8.0]],
        ),
        (
            "<path clip-rule='evenodd' d='M10,0 H90 V80 H10 Z M40,20 H60 V60 H40 Z'/>",
            vec![[1.0, 4.0], [6.0, 9.0]],
        ),
    ] {
        let text =
            page(&format!("<clipPath id='c'>{clip}</clipPath><g clip-path='url(#c)'>{LINE}</g>"));
        let found = walls(&drawing(&text).expect("a drawing"));
        let expected: Vec<[f64; 4]> =
            spans.iter().map(|[from, to]| [*from, 4.0, *to, 4.0]).collect();
        assert_eq!(found, expected, "{clip}");
    }
}

#[test]
fn curves_of_any_size_are_bounded() {
    // The outline of an unbounded curve is computed without end.
    for great in ["<circle r='1e30'/>", "<path d='M3,1e30 A20,20 0 0 1 50,10'/>"] {
        let error = drawing(&page(great)).expect_err("no drawing");
        assert!(error.to_string().contains("more than 1e7"), "{error}");
    }
    let arc = page("<path d='M0,9999 A20,20 0 0 1 50,10'/>");
    let count = walls(&drawing(&arc).expect("a drawing")).len();
    assert!((200..=1024).contains(&count), "{count}");
    drawing(&arc.replace("9999", "9999999")).expect("a drawing");
}
