//! Construction of scenes in code.

use serde_json::{Map, Value, json};

use super::{Scene, SceneError};

/// Builder of a scene without a file.
///
/// The builder holds a scene file: [`build`](Self::build) validates it by the same rules, and
/// [`text`](Self::text) returns its text for other programs.
///
/// ```
/// use sonard_model::scene::Scene;
///
/// let room = Scene::builder("kitchen")
///     .material("plaster", 0.97)
///     .room("wall", &[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]], "plaster")
///     .walls("counter", &[[0.0, 2.4], [1.8, 2.4], [1.8, 3.0]], "plaster")
///     .z_range(0.0, 0.9)
///     .cylinder("leg", [2.5, 1.0], 0.02, "plaster")
///     .heights(0.0, 2.5)
///     .floor_and_ceiling("plaster", "plaster")
///     .pose("door", 3.5, 0.4, 90.0)
///     .build()?;
/// assert_eq!((room.walls.len(), room.cylinders.len()), (6, 1));
/// assert_eq!(room.walls[4].z_m, Some([0.0, 0.9]));
/// # Ok::<(), sonard_model::scene::SceneError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SceneBuilder {
    file: Map<String, Value>,
    /// List that the last wall or cylinder was added to.
    last: Option<&'static str>,
}

impl Scene {
    /// Starts an empty scene of that name.
    #[must_use]
    pub fn builder(name: &str) -> SceneBuilder {
        let file =
            json!({"name": name, "materials": {}, "walls": [], "cylinders": [], "poses": {}});
        let Value::Object(file) = file else { unreachable!("it is written as an object") };
        SceneBuilder { file, last: None }
    }
}

impl SceneBuilder {
    /// Adds a smooth surface with an amplitude reflection coefficient of 0 to 1.
    #[must_use]
    pub fn material(self, name: &str, reflectance: f64) -> Self {
        self.rough_material(name, reflectance, 0.0)
    }

    /// Adds a surface that scatters a share of the unabsorbed sound, 0 to 1.
    #[must_use]
    pub fn rough_material(mut self, name: &str, reflectance: f64, roughness: f64) -> Self {
        self.file["materials"][name] = json!({"reflectance": reflectance, "roughness": roughness});
        self
    }

    /// Adds a row of walls along corners, in metres. A single wall keeps `id` as its name; several
    /// are `id.0`, `id.1`, ...
    #[must_use]
    pub fn walls(self, id: &str, corners: &[[f64; 2]], material: &str) -> Self {
        let wall = match corners {
            [from, to] => json!({"id": id, "from": from, "to": to, "material": material}),
            _ => json!({"id": id, "polyline": corners, "material": material}),
        };
        self.with("walls", wall)
    }

    /// Adds a closed row of walls, with a last wall back to the first corner.
    #[must_use]
    pub fn room(self, id: &str, corners: &[[f64; 2]], material: &str) -> Self {
        let wall = json!({"id": id, "polyline": corners, "closed": true, "material": material});
        self.with("walls", wall)
    }

    /// Adds an upright circular reflector; dimensions in metres.
    #[must_use]
    pub fn cylinder(self, id: &str, center: [f64; 2], radius_m: f64, material: &str) -> Self {
        let cylinder =
            json!({"id": id, "center": center, "radius_m": radius_m, "material": material});
        self.with("cylinders", cylinder)
    }

    /// Sets the lower and upper height, metres, of the walls or the cylinder added last, instead of
    /// floor to ceiling.
    #[must_use]
    pub fn z_range(mut self, bottom_z_m: f64, top_z_m: f64) -> Self {
        if let Some(Value::Array(list)) = self.last.and_then(|list| self.file.get_mut(list))
            && let Some(last) = list.last_mut()
        {
            last["z_m"] = json!([bottom_z_m, top_z_m]);
        }
        self
    }

    /// Sets the heights of floor and ceiling, metres; without them the scene is planar.
    #[must_use]
    pub fn heights(mut self, floor_z_m: f64, ceiling_z_m: f64) -> Self {
        self.file.insert("floor_z_m".into(), json!(floor_z_m));
        self.file.insert("ceiling_z_m".into(), json!(ceiling_z_m));
        self
    }

    /// Sets the materials of floor and ceiling; rigid by default.
    #[must_use]
    pub fn floor_and_ceiling(mut self, floor_material: &str, ceiling_material: &str) -> Self {
        self.file.insert("floor_material".into(), json!(floor_material));
        self.file.insert("ceiling_material".into(), json!(ceiling_material));
        self
    }

    /// Adds a named pose of the ranger: metres, and the heading in degrees counter-clockwise from
    /// +x.
    #[must_use]
    pub fn pose(mut self, name: &str, x_m: f64, y_m: f64, heading_deg: f64) -> Self {
        self.file["poses"][name] = json!({"x_m": x_m, "y_m": y_m, "heading_deg": heading_deg});
        self
    }

    /// Text of the scene file.
    #[must_use]
    pub fn text(&self) -> String {
        format!("{:#}\n", Value::Object(self.file.clone()))
    }

    /// Builds and validates the scene.
    ///
    /// # Errors
    /// As [`Scene::from_json`] of [`text`](Self::text): the error names the wall, cylinder or pose,
    /// and the valid values.
    pub fn build(&self) -> Result<Scene, SceneError> {
        Scene::from_json(&self.text())
    }

    fn with(mut self, list: &'static str, entry: Value) -> Self {
        if let Some(Value::Array(entries)) = self.file.get_mut(list) {
            entries.push(entry);
        }
        Self { last: Some(list), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_reproduces_the_scene() {
        let builder = Scene::builder("room")
            .rough_material("felt", 0.3, 0.5)
            .walls("screen", &[[0.0, 0.0], [1.0, 0.1]], "felt")
            .pose("here", 0.5, -1.0, 90.0);
        let scene = builder.build().expect("a scene");
        assert_eq!(Scene::from_json(&builder.text()), Ok(scene.clone()));
        assert_eq!(&*scene.walls[0].id, "screen");
        assert_eq!(scene.poses["here"].y_m, -1.0);
    }

    #[test]
    fn errors_name_the_path() {
        let bare = Scene::builder("room").material("wood", 0.9);
        for (scene, path) in [
            (bare.clone().walls("w", &[[0.0, 0.0], [1.0, 0.0]], "glass"), "walls[0].material"),
            (bare.clone().cylinder("c", [0.0, 0.0], -1.0, "wood"), "cylinders[0].radius_m"),
            (bare.clone().material("ice", 1.5), "materials.ice.reflectance"),
            (bare.clone().pose("p", f64::NAN, 0.0, 0.0), "poses.p.x_m"),
            (bare.walls("w", &[[0.0, 0.0]], "wood"), "walls[0].polyline"),
        ] {
            let error = scene.build().expect_err(path);
            assert_eq!(error.path, path, "{error}");
        }
    }
}
