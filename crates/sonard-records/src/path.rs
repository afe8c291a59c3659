//! The path of an echo as it stands in a log.

use std::fmt;

use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, SeqAccess, Visitor},
};
use sonard_model::{geometry::DVec2, model::FACE_NAME};

use crate::{PathKind, Ping};

/// The path of an echo.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PathRecord {
    /// How the sound got back.
    pub kind: PathKind,
    /// Number of mirror reflections: at walls, cylinders, floor and ceiling.
    pub order: u32,
    /// What the sound met, from the transmitter to the receiver. From logs of format 1, which do not say
    /// in which order edges, floor and ceiling are met among the walls, without points: then edges stand
    /// before the walls, floor and ceiling after them.
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
    /// Where, to a micrometre; absent where it is not known, in records from logs of format 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<Point>,
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
    /// One whose place is not known.
    #[must_use]
    pub fn unplaced(kind: InteractionKind, id: impl Into<String>) -> Self {
        Self { kind, id: id.into(), point: None }
    }

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

    /// The path as a line in the plan, between transmitter and receiver at these places; `None` of a record
    /// from a log of format 1.
    #[must_use]
    pub fn polyline(&self, [transmitter, receiver]: [DVec2; 2]) -> Option<Vec<DVec2>> {
        let points = self.interactions.iter().map(|met| Some(met.point?.plan()));
        [Some(transmitter)].into_iter().chain(points).chain([Some(receiver)]).collect()
    }
}

impl Ping {
    /// The path of its sound: of a simulated reading its own, else the one that the model predicts.
    #[must_use]
    pub fn sound_path(&self) -> Option<&PathRecord> {
        self.path.as_ref().or_else(|| self.sim.as_ref()?.path.as_ref())
    }
}

/// A path in format 2, or in format 1, which keeps `walls` and edges apart and says no points.
#[derive(Deserialize)]
struct Read {
    kind: PathKind,
    order: u32,
    interactions: Option<Vec<InteractionRecord>>,
    walls: Option<Vec<String>>,
    edge: Option<String>,
    second_edge: Option<String>,
    length_m: f64,
}

impl<'de> Deserialize<'de> for PathRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Read { kind, order, interactions, walls, edge, second_edge, length_m } =
            Read::deserialize(deserializer)?;
        match (interactions, walls) {
            (Some(interactions), _) => Ok(Self { kind, order, interactions, length_m }),
            (None, Some(walls)) => {
                let edges = edge.into_iter().chain(second_edge).collect();
                Ok(Self::of_format_1(kind, walls, edges, length_m))
            }
            (None, None) => Err(D::Error::missing_field("interactions")),
        }
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

impl PathRecord {
    /// In format 1 the wall that scatters stands in the middle of `walls`, because scattered sound goes back
    /// as it came, and the own wall of a level edge is one of them; its `order` counted all of these.
    fn of_format_1(kind: PathKind, walls: Vec<String>, edges: Vec<String>, length_m: f64) -> Self {
        let middle = walls.len() / 2;
        let of_wall = |(place, id): (usize, String)| {
            let kind = match kind {
                _ if id == FACE_NAME => InteractionKind::Transducer,
                PathKind::Scattered if place == middle => InteractionKind::Scattering,
                _ => InteractionKind::Reflection,
            };
            InteractionRecord::unplaced(kind, id)
        };
        let mut interactions: Vec<_> = walls.into_iter().enumerate().map(of_wall).collect();
        for (number, edge) in edges.into_iter().enumerate() {
            let own = interactions.iter().position(|met| {
                met.kind == InteractionKind::Reflection
                    && level_edge_wall(&edge) == Some(met.id.as_str())
            });
            let bend = InteractionRecord::unplaced(InteractionKind::Diffraction, edge);
            match own {
                Some(place) => interactions[place] = bend,
                None => interactions.insert(number, bend),
            }
        }
        let is_mirror = |met: &&InteractionRecord| met.kind == InteractionKind::Reflection;
        let order = interactions.iter().filter(is_mirror).count() as u32;
        Self { kind, order, interactions, length_m }
    }
}

/// The wall of an edge that is its upper or lower one.
fn level_edge_wall(edge: &str) -> Option<&str> {
    edge.strip_suffix(".top").or_else(|| edge.strip_suffix(".bottom"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PathRecord, serde_json::Error> {
        serde_json::from_str(text)
    }

    type Met<'a> = &'a [(InteractionKind, &'a str)];

    fn words(path: &PathRecord) -> Vec<(InteractionKind, &str)> {
        path.interactions.iter().map(|met| (met.kind, met.id.as_str())).collect()
    }

    #[test]
    fn paths_of_format_1_are_read_without_points() {
        use InteractionKind::{Diffraction, Reflection, Scattering, Transducer};
        let cases: [(&str, u32, Met<'_>); 5] = [
            (
                r#"{"kind":"specular","order":3,"walls":["south","transducer","south"],"length_m":1}"#,
                2,
                &[(Reflection, "south"), (Transducer, "transducer"), (Reflection, "south")],
            ),
            (
                r#"{"kind":"scattered","order":3,"walls":["a","b","a"],"length_m":1}"#,
                2,
                &[(Reflection, "a"), (Scattering, "b"), (Reflection, "a")],
            ),
            (
                r#"{"kind":"diffracted","order":3,"walls":["high","low","floor"],"edge":"low.top","length_m":1}"#,
                2,
                &[(Reflection, "high"), (Diffraction, "low.top"), (Reflection, "floor")],
            ),
            (
                r#"{"kind":"diffracted","order":1,"walls":["south"],"edge":"p.a","second_edge":"p.b","length_m":1}"#,
                1,
                &[(Diffraction, "p.a"), (Diffraction, "p.b"), (Reflection, "south")],
            ),
            (
                r#"{"kind":"diffracted","order":0,"walls":[],"edge":"x.top","length_m":1}"#,
                0,
                &[(Diffraction, "x.top")],
            ),
        ];
        for (text, order, met) in cases {
            let path = read(text).expect(text);
            assert_eq!((path.order, words(&path)), (order, met.to_vec()), "{text}");
            assert_eq!(path.polyline([DVec2::ZERO; 2]), None, "{text}");
            // Written again it is of format 2, and reads the same.
            let written = serde_json::to_string(&path).expect("JSON");
            assert!(!written.contains("walls") && !written.contains("point"), "{written}");
            assert_eq!(read(&written).expect(&written), path);
        }
        let neither = read(r#"{"kind":"specular","order":1,"length_m":1}"#).expect_err("no path");
        assert!(neither.to_string().contains("interactions"), "{neither}");
    }

    #[test]
    fn points_are_of_two_coordinates_or_of_three() {
        let text = r#"{"kind":"specular","order":2,"interactions":[
            {"kind":"reflection","id":"south","point":[0.5,-0.25]},
            {"kind":"reflection","id":"floor","point":[0.75,0.5,0.0]}],"length_m":1.5}"#;
        let path = read(text).expect(text);
        let at = DVec2::new(1.0, 2.0);
        let line = [at, DVec2::new(0.5, -0.25), DVec2::new(0.75, 0.5), at];
        assert_eq!(path.polyline([at; 2]), Some(line.to_vec()));
        assert!(read(&text.replace("[0.5,-0.25]", "[0.5]")).is_err());
        assert_eq!(
            Point::rounded(DVec2::new(1.0 / 3.0, -1e-9), Some(0.1)),
            Point::Space([0.333_333, 0.0, 0.1])
        );
    }

    #[test]
    fn what_was_met_is_told_in_order_and_edges_as_such() {
        let text = r#"{"kind":"diffracted","order":1,"walls":["south"],"edge":"p.a","length_m":1}"#;
        let path = read(text).expect(text);
        assert_eq!(path.in_words(), "edge p.a, south");
        assert_eq!(["p.a", "south", "p"].map(|id| path.meets(id)), [true, true, false]);
    }
}
