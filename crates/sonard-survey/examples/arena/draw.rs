//! Picture of the plans found over the arena.

use std::fmt::Write;

use sonard_model::geometry::DVec2;
use sonard_survey::trial::Ends;

/// Plan found by a run, in the frame of the arena.
pub(crate) struct DrawnPlan<'a> {
    pub(crate) title: &'a str,
    pub(crate) walls: Vec<Ends>,
    /// Places of the sweeps and of their echoes.
    pub(crate) places: Vec<DVec2>,
    pub(crate) echoes: Vec<DVec2>,
}

/// Draws plans side by side, the true walls wide and grey below each.
pub(crate) fn draw_plans(plans: &[DrawnPlan], truth: &[Ends]) -> String {
    const COLUMNS: usize = 3;
    const CELL_PX: f64 = 360.0;
    const PX_PER_M: f64 = 130.0;
    const MARGIN_PX: f64 = 45.0;
    let size =
        [COLUMNS.min(plans.len()), plans.len().div_ceil(COLUMNS)].map(|of| of as f64 * CELL_PX);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" font-family=\"sans-serif\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        size[0], size[1]
    );
    for (at, plan) in plans.iter().enumerate() {
        let corner = [at % COLUMNS, at / COLUMNS].map(|of| of as f64 * CELL_PX);
        let px = |of: DVec2| {
            let [x, y] = [MARGIN_PX + PX_PER_M * of.x, CELL_PX - MARGIN_PX - PX_PER_M * of.y];
            [corner[0] + x, corner[1] + y]
        };
        let mut line = |[a, b]: &Ends, style: &str| {
            let ([x1, y1], [x2, y2]) = (px(*a), px(*b));
            let _ = writeln!(
                svg,
                "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {style}/>"
            );
        };
        truth.iter().for_each(|wall| line(wall, "stroke=\"#c8c8c8\" stroke-width=\"9\""));
        plan.walls.iter().for_each(|wall| line(wall, "stroke=\"#b02020\" stroke-width=\"2.5\""));
        let mut dot = |of: &DVec2, radius: f64, color: &str| {
            let [x, y] = px(*of);
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{color}\"/>"
            );
        };
        plan.echoes.iter().for_each(|echo| dot(echo, 1.2, "#3060a0"));
        plan.places.iter().for_each(|place| dot(place, 4.0, "black"));
        let [x, y] = [corner[0] + MARGIN_PX, corner[1] + 22.0];
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"{y}\" font-size=\"15\">{}</text>", plan.title);
    }
    svg.push_str("</svg>\n");
    svg
}
