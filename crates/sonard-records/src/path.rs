//! Propagation path of an echo in a log record.

use std::fmt;

use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, SeqAccess, Visitor},
};
use sonard_model::geometry::DVec2;

use crate::{PathKind, Ping};

/// Propagation path of an echo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PathRecord {
    /// Kind of the propagation path.
    pub kind: PathKind,
    /// Number of mirror reflections: at walls, cylinders, floor and ceiling.
    pub order: u32,
    /// Interactions in order, from the transmitter to the receiver.
    pub interactions: Vec<InteractionRecord>,
    /// Round-trip length of the path, metres.
    pub length_m: f64,
}

/// Point at which the sound changes direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InteractionRecord {
    /// Kind of the interaction.
    pub kind: InteractionKind,
    /// Id of the reflector: a wall or cylinder, `floor`, `ceiling` or `transducer`. For diffraction
    /// the edge: `WALL.a` or `WALL.b` for the vertical edges at the ends of a wall, `WALL.top` or
    /// `WALL.bottom` for the horizontal edges of a wall of limited height.
    pub id: String,
    /// Position of the interaction, rounded to a micrometre.
    pub point: Point,
}

/// Kind of an interaction with a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InteractionKind {
    /// Mirror reflection at a surface.
    Reflection,
    /// Diffraction at an edge.
    Diffraction,
    /// Diffuse scattering by a rough wall.
    Scattering,
    /// Reflection from the transducer's own face.
    Transducer,
}

/// Position in the scene, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Point {
    /// Coordinates `[x, y]`, in a scene without floor and ceiling.
    Plan([f64; 2]),
    /// Coordinates `[x, y, z]`.
    Space([f64; 3]),
}

impl Point {
    /// Rounds to a micrometre, which keeps records short.
    #[must_use]
    pub fn rounded(plan: DVec2, z_m: Option<f64>) -> Self {
        // Adding 0.0 removes a negative zero.
        let round = |value: f64| (value * 1e6).round() / 1e6 + 0.0;
        let [x, y] = plan.to_array().map(round);
        z_m.map_or(Self::Plan([x, y]), |z_m| Self::Space([x, y, round(z_m)]))
    }

    /// Position in the plan.
    #[must_use]
    pub const fn plan(self) -> DVec2 {
        let (Self::Plan([x, y]) | Self::Space([x, y, _])) = self;
        DVec2::new(x, y)
    }

    /// Returns `true` if all coordinates are finite.
    pub(crate) fn is_finite(self) -> bool {
        match self {
            Self::Plan(at) => at.iter().all(|value| value.is_finite()),
            Self::Space(at) => at.iter().all(|value| value.is_finite()),
        }
    }
}

impl InteractionRecord {
    fn label(&self) -> String {
        match self.kind {
            InteractionKind::Diffraction => format!("edge {}", self.id),
            _ => self.id.clone(),
        }
    }
}

impl PathRecord {
    /// Ids of the interactions in order, edges marked as such.
    #[must_use]
    pub fn describe(&self) -> String {
        let parts: Vec<String> = self.interactions.iter().map(InteractionRecord::label).collect();
        parts.join(", ")
    }

    /// Returns `true` if the path interacts with a wall, cylinder or edge.
    #[must_use]
    pub fn includes(&self, id: &str) -> bool {
        self.interactions.iter().any(|interaction| interaction.id == id)
    }

    /// Path as a polyline in the plan, metres: transmitter, interactions, receiver.
    #[must_use]
    pub fn polyline(&self, [transmitter, receiver]: [DVec2; 2]) -> Vec<DVec2> {
        let points = self.interactions.iter().map(|interaction| interaction.point.plan());
        [transmitter].into_iter().chain(points).chain([receiver]).collect()
    }
}

impl Ping {
    /// Path of the received sound: the reading's own if simulated, else the predicted one.
    #[must_use]
    pub fn sound_path(&self) -> Option<&PathRecord> {
        self.path.as_ref().or_else(|| self.sim.as_ref()?.path.as_ref())
    }
}

impl<'de> Deserialize<'de> for Point {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Coordinates;
        impl<'de> Visitor<'de> for Coordinates {
            type Value = Point;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("[x, y] or [x, y, z], metres")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Point, A::Error> {
                let mut at = [0.0; 3];
                let mut count = 0;
                while let Some(value) = seq.next_element()? {
                    *at.get_mut(count)
                        .ok_or_else(|| A::Error::invalid_length(count + 1, &self))? = value;
                    count += 1;
                }
                match count {
                    2 => Ok(Point::Plan([at[0], at[1]])),
                    3 => Ok(Point::Space(at)),
                    _ => Err(A::Error::invalid_length(count, &self)),
                }
            }
        }
        deserializer.deserialize_seq(Coordinates)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PathRecord, serde_json::Error> {
        serde_json::from_str(text)
    }

    #[test]
    fn points_have_two_or_three_values() {
        let text = r#"{"kind":"specular","order":2,"interactions":[
            {"kind":"reflection","id":"south","point":[0.5,-0.25]},
            {"kind":"reflection","id":"floor","point":[0.75,0.5,0.0]}],"length_m":1.5}"#;
        let path = read(text).expect(text);
        let at = DVec2::new(1.0, 2.0);
        let line = [at, DVec2::new(0.5, -0.25), DVec2::new(0.75, 0.5), at];
        assert_eq!(path.polyline([at; 2]), line);
        assert!(read(&text.replace("[0.5,-0.25]", "[0.5]")).is_err());
        assert!(read(&text.replace(",\"point\":[0.5,-0.25]", "")).is_err());
        assert_eq!(
            Point::rounded(DVec2::new(1.0 / 3.0, -1e-9), Some(0.1)),
            Point::Space([0.333_333, 0.0, 0.1])
        );
    }

    #[test]
    fn describes_interactions_in_order() {
        let text = r#"{"kind":"diffracted","order":1,"interactions":[
            {"kind":"diffraction","id":"p.a","point":[0.5,0.25]},
            {"kind":"reflection","id":"south","point":[0.5,0.0]}],"length_m":1}"#;
        let path = read(text).expect(text);
        assert_eq!(path.describe(), "edge p.a, south");
        assert_eq!(["p.a", "south", "p"].map(|id| path.includes(id)), [true, true, false]);
    }
}
