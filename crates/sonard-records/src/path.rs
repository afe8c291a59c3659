//! The path of an echo as it stands in a log.

use std::fmt;

use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, SeqAccess, Visitor},
};
use sonard_model::geometry::DVec2;

use crate::{PathKind, Ping};

/// The path of an echo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PathRecord {
    /// How the sound got back.
    pub kind: PathKind,
    /// Number of mirror reflections: at walls, cylinders, floor and ceiling.
    pub order: u32,
    /// Interactions in order, from the transmitter to the receiver.
    pub interactions: Vec<InteractionRecord>,
    /// Length there and back, metres.
    pub length_m: f64,
}

/// A point where the sound changed its direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InteractionRecord {
    /// What changed it.
    pub kind: InteractionKind,
    /// By what: the id of a wall or cylinder, `floor`, `ceiling` or `transducer`; of diffraction the edge,
    /// `WALL.a` or `WALL.b` for the upright ones at the ends of a wall, `WALL.top` or `WALL.bottom` for
    /// the level ones of a wall that ends below or above.
    pub id: String,
    /// Place of the interaction, to a micrometre.
    pub point: Point,
}

/// Kind of a change of direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InteractionKind {
    /// Mirror reflection.
    Reflection,
    /// Diffraction at an edge.
    Diffraction,
    /// Diffuse scattering by a rough wall.
    Scattering,
    /// Return from the transducer's own face.
    Transducer,
}

/// A place of the scene, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Point {
    /// `[x, y]`, in a scene without floor and ceiling.
    Plan([f64; 2]),
    /// `[x, y, z]`.
    Space([f64; 3]),
}

impl Point {
    /// Rounded to a micrometre, which keeps records short.
    #[must_use]
    pub fn rounded(plan: DVec2, z_m: Option<f64>) -> Self {
        // No negative zero.
        let round = |value: f64| (value * 1e6).round() / 1e6 + 0.0;
        let [x, y] = plan.to_array().map(round);
        z_m.map_or(Self::Plan([x, y]), |z_m| Self::Space([x, y, round(z_m)]))
    }

    /// The place in the plan.
    #[must_use]
    pub const fn plan(self) -> DVec2 {
        let (Self::Plan([x, y]) | Self::Space([x, y, _])) = self;
        DVec2::new(x, y)
    }

    /// Whether all its coordinates are numbers.
    pub(crate) fn is_finite(self) -> bool {
        match self {
            Self::Plan(at) => at.iter().all(|value| value.is_finite()),
            Self::Space(at) => at.iter().all(|value| value.is_finite()),
        }
    }
}

impl InteractionRecord {
    /// Its id; of an edge with that word.
    fn in_words(&self) -> String {
        match self.kind {
            InteractionKind::Diffraction => format!("edge {}", self.id),
            _ => self.id.clone(),
        }
    }
}

impl PathRecord {
    /// What the sound met, in order.
    #[must_use]
    pub fn in_words(&self) -> String {
        let met: Vec<String> = self.interactions.iter().map(InteractionRecord::in_words).collect();
        met.join(", ")
    }

    /// Whether it met that wall, cylinder or edge.
    #[must_use]
    pub fn meets(&self, id: &str) -> bool {
        self.interactions.iter().any(|met| met.id == id)
    }

    /// Path as a line in the plan, from the transmitter over the interactions to the receiver, metres.
    #[must_use]
    pub fn polyline(&self, [transmitter, receiver]: [DVec2; 2]) -> Vec<DVec2> {
        let points = self.interactions.iter().map(|met| met.point.plan());
        [transmitter].into_iter().chain(points).chain([receiver]).collect()
    }
}

impl Ping {
    /// The path of its sound: of a simulated reading its own, else the one that the model predicts.
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
    fn points_are_of_two_coordinates_or_of_three() {
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
    fn what_was_met_is_told_in_order_and_edges_as_such() {
        let text = r#"{"kind":"diffracted","order":1,"interactions":[
            {"kind":"diffraction","id":"p.a","point":[0.5,0.25]},
            {"kind":"reflection","id":"south","point":[0.5,0.0]}],"length_m":1}"#;
        let path = read(text).expect(text);
        assert_eq!(path.in_words(), "edge p.a, south");
        assert_eq!(["p.a", "south", "p"].map(|id| path.meets(id)), [true, true, false]);
    }
}
