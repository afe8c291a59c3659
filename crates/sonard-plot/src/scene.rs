//! Picture of a scene.

use super::{
    canvas::{Anchor, Layer, Px, Rect},
    caption,
    labels::Labels,
    legend, legend_entries,
    picture::Picture,
    plan::{Bounds, PlanProjection},
    theme,
};
use sonard_model::{geometry::DVec2, scene::Scene};

/// Draws a scene's floor plan: walls in a line style for each material, their names, cylinders,
/// the named poses with their headings, and a scale bar.
#[must_use]
pub fn draw_scene(scene: &Scene) -> Picture {
    let (heading, top) = caption::draw(&scene.name, None, &notes(scene));
    let region = region(scene);
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let height = PlanProjection::height_for(&region, right - left, [220.0, 640.0]);
    let plan = PlanProjection::fit(region, Rect::new(left, top + 22.0, right - left, height));
    let mut labels = plan.labels(Some(scene));

    let mut page = Layer::new("scene");
    page.add(heading);
    page.add(plan.frame());
    page.add(plan.walls(scene));
    page.add(poses(&plan, scene, &mut labels));
    page.add(plan.names(scene, &mut labels));
    page.add(plan.scale_bar());
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let (entries, legend_height) =
        legend::draw(&legend_entries::materials(scene), below, right - left);
    page.add(entries);
    Picture::new(theme::PAGE_PX, below.y + legend_height + theme::MARGIN_PX / 2.0, page)
}

/// Notes on sources, heights and approximations.
fn notes(scene: &Scene) -> Vec<String> {
    let source = scene.source.iter().map(|source| format!("Source: {source}"));
    let heights = match (scene.floor_z_m, scene.ceiling_z_m) {
        (None, None) => None,
        (floor, ceiling) => {
            let part = |name: &str, z: Option<f64>| z.map(|z| format!("{name} at {z} m"));
            let parts = [part("floor", floor), part("ceiling", ceiling)];
            Some(format!("With {}", parts.into_iter().flatten().collect::<Vec<_>>().join(", ")))
        }
    };
    let approximations = (!scene.approximate.is_empty())
        .then(|| format!("Approximate: {}", scene.approximate.join(" ")));
    source.chain(heights).chain(approximations).collect()
}

/// Bounds of everything drawn, with a margin; a square metre if there is nothing.
fn region(scene: &Scene) -> Bounds {
    let poses = scene.poses.values().flat_map(|pose| {
        let body = Bounds::from_scene(&scene.with_robot_at(pose)).map(|b| [b.min, b.max]);
        body.into_iter().flatten().chain([pose.position()])
    });
    let all = match Bounds::from_scene(scene) {
        Some(walls) => Some(walls.including(poses)),
        None => Bounds::around(poses),
    };
    let all = all.unwrap_or(Bounds { min: DVec2::ZERO, max: DVec2::ONE });
    let size = all.size().max_element();
    all.grown(if size > 0.0 { 0.08 * size } else { 0.5 })
}

fn poses(plan: &PlanProjection, scene: &Scene, labels: &mut Labels) -> Layer {
    let mut layer = Layer::new("poses");
    for (name, pose) in &scene.poses {
        layer.add(plan.body(scene, pose));
        layer.add(plan.pose(pose));
        let at = plan.px(pose.position());
        plan.avoid_pose(pose, labels);
        let places = [
            (Px::new(9.0, -9.0), Anchor::Start),
            (Px::new(9.0, 18.0), Anchor::Start),
            (Px::new(-9.0, -9.0), Anchor::End),
            (Px::new(-9.0, 18.0), Anchor::End),
        ];
        let free = places
            .into_iter()
            .find(|(shift, anchor)| labels.place(at + *shift, *anchor, theme::TEXT_PX, name));
        if let Some((shift, anchor)) = free {
            layer.text(at + shift, anchor, theme::TEXT_PX, name);
        }
    }
    layer
}
