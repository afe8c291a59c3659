//! Line styles of materials.

use super::theme;
use sonard_model::scene::{Material, Scene};

/// Materials of a scene, most specular first.
#[derive(Debug, Clone)]
pub(super) struct Materials(Vec<Material>);

impl Materials {
    pub(super) fn from_scene(scene: &Scene) -> Self {
        let walls = scene.walls.iter().map(|wall| wall.material);
        let cylinders = scene.cylinders.iter().map(|cylinder| cylinder.material);
        let mut found: Vec<Material> = Vec::new();
        for material in walls.chain(cylinders) {
            if !found.contains(&material) {
                found.push(material);
            }
        }
        found.sort_by(|a, b| {
            a.roughness.total_cmp(&b.roughness).then(b.reflectance.total_cmp(&a.reflectance))
        });
        Self(found)
    }

    /// Dash patterns with their materials.
    pub(super) fn styles(&self) -> impl Iterator<Item = (&'static str, Material)> {
        self.0
            .iter()
            .enumerate()
            .map(|(i, material)| (theme::WALL_DASHES[i % theme::WALL_DASHES.len()], *material))
    }

    /// Legend label of a material.
    pub(super) fn describe(material: &Material) -> String {
        let roughness = if material.roughness > 0.0 {
            format!(", roughness {}", material.roughness)
        } else {
            String::new()
        };
        format!("wall, reflectance {}{roughness}", material.reflectance)
    }
}
