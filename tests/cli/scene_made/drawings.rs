//! Drawings in SVG: markers, clip paths, compression.

use std::{fs, io::Write as _};

use super::*;

/// A drawing of 100 by 80 that is ten metres wide.
fn svg(content: &str) -> (Vec<[f64; 4]>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.svg");
    fs::write(
        &path,
        format!("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 80'>{content}</svg>"),
    )
    .expect("writable");
    let path = path.to_str().expect("a plain path");
    let scene = made(&["scene", "from-svg", path, "--width-m", "10"]);
    let ends = scene.walls.iter().map(|wall| [wall.a.x, wall.a.y, wall.b.x, wall.b.y]);
    let rounded = ends.map(|ends| ends.map(|m| (1e3 * m).round() / 1e3)).collect();
    (rounded, stderr(&run(&["scene", "from-svg", path, "--width-m", "10"])))
}

#[test]
fn markers_and_clip_paths() {
    let marker = "<defs><marker id='a' orient='auto' style='overflow:visible'><path d='M 5,0 -3,5 V -5 Z'/></marker></defs>";
    for ends in
        ["marker-end:url(#a)", "marker-start:url(#a)", "marker-mid:url(#a)", "marker:url(#a)"]
    {
        let line = format!(
            "{marker}<path d='M 10 10 L 50 10 L 90 10' stroke='black' fill='none' style='{ends}'/>"
        );
        let (found, _) = svg(&line);
        assert!(
            found.iter().all(|wall| wall[1] == 7.0 && wall[3] == 7.0) && found.len() == 2,
            "{ends}: {found:?}"
        );
    }
    let clip = "<clipPath id='c'><rect x='40' y='0' width='20' height='80'/></clipPath><g clip-path='url(#c)'>\
                <line x1='0' y1='40' x2='100' y2='40' stroke='black'/></g>";
    assert_eq!(svg(clip), (vec![[4.0, 4.0, 6.0, 4.0]], String::new()));
    let moved = clip.replace("<g clip", "<g transform='translate(10 0)' clip");
    assert_eq!(svg(&moved).0, [[5.0, 4.0, 7.0, 4.0]]);
    let inner = "<svg x='20' y='20' width='40' height='40' viewBox='0 0 40 40'><line x1='10' y1='20' x2='70' y2='20' stroke='black'/></svg>";
    assert_eq!(svg(inner).0, [[3.0, 4.0, 6.0, 4.0]]);
    let (found, printed) = svg(&clip.replace(
        "<rect x='40' y='0' width='20' height='80'/>",
        "<circle cx='50' cy='40' r='10'/>",
    ));
    assert_eq!((found, printed), (vec![[4.0, 4.0, 6.0, 4.0]], String::new()));
}

#[test]
fn compressed_and_unsized_drawings() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.svgz");
    let text = "<svg xmlns='http://www.w3.org/2000/svg'><line x1='0' y1='5' x2='100' y2='5' stroke='black'/></svg>";
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(text.as_bytes()).expect("memory takes it");
    fs::write(&path, packed.finish().expect("memory takes it")).expect("writable");
    let output =
        run(&["scene", "from-svg", path.to_str().expect("a plain path"), "--width-m", "10"]);
    let printed = stderr(&output);
    assert!(output.status.success() && printed.contains("neither width nor viewBox"), "{printed}");
}
