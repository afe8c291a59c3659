//! Upper edges of low walls, and lower edges of hanging ones.
//!
//! Such a rim lies level, so of rays that come from an image of the ranger and go back the way they
//! came it answers where the perpendicular from the image meets it: in the plan the foot on the
//! wall, in height the rim. From `d` before the wall and `h` below the rim that is `sqrt(d^2 + h^2)`
//! off. To the plane across it the wall is a half plane, seen from `atan2(d, h)` off its face, and
//! Kouyoumjian and Pathak's coefficient says how strong it answers. It takes over where the wall's own
//! echo ends because the wall does: when the ranger rises past the rim, nothing jumps.
//!
//! Left out are ways that go back otherwise than they came (off the perpendicular, along Keller's
//! cone), by floor or ceiling, or to a receiver elsewhere; a wall counts as thin.

use std::f64::consts::TAU;

use super::{
    Echo, Paths, Via,
    beam::TIE_M,
    heights::Ends,
    scatter::Lit,
    trace::Tree,
    ways::{Leg, Part},
};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, Wedge},
    geometry::DVec2,
    model::Reflector,
};

/// A place on a rim that sound comes back from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rim {
    pub(super) wall: u32,
    /// Whether it is the wall's upper one.
    pub(super) is_upper: bool,
    pub(super) leg: Leg,
    pub(super) place: DVec2,
}

/// The echoes of all rims in sight from `start`; their places go to [`Tree::rims`].
pub(super) fn echoes(paths: &Paths, tree: &mut Tree, start: DVec2, law: EdgeLaw) -> Vec<Echo> {
    let mut echoes = Vec::new();
    for lit in std::mem::take(&mut tree.passed) {
        let Lit { beam, wall, span_m: [low_m, high_m] } = lit;
        let mirror = &paths.faces[wall as usize].mirror;
        let foot_m = mirror.normal.perp().dot(beam.image);
        if !(low_m - TIE_M..=high_m + TIE_M).contains(&foot_m) {
            continue;
        }
        let place = beam.image - mirror.height_m(beam.image) * mirror.normal;
        let ray = beam.ray_to(place);
        for (rise_m, is_upper) in paths.heights.rims(wall) {
            let rim = Rim { wall, is_upper, leg: (&ray).into(), place };
            let number = tree.rims.len() as u32;
            let Some(echo) = echo(paths, lit, place - beam.image, rise_m, is_upper, law) else {
                continue;
            };
            if paths.is_rim_clear(tree, &rim, start, rise_m) {
                tree.rims.push(rim);
                echoes.push(Echo { via: Via::Rim { rim: number }, ..echo });
            }
        }
    }
    echoes
}

/// The echo of a rim `rise_m` above the ranger, at the end of a run in the plan.
fn echo(
    paths: &Paths,
    Lit { beam, wall, .. }: Lit,
    run: DVec2,
    rise_m: f64,
    is_upper: bool,
    law: EdgeLaw,
) -> Option<Echo> {
    let settings = &paths.settings;
    let plan_m = run.length();
    let distance_m = plan_m.hypot(rise_m);
    let length_m = 2.0 * distance_m;
    if length_m > settings.max_path_m || !settings.allows(2 * beam.order) {
        return None;
    }
    let gain = paths.faces[wall as usize].gain;
    let wedge = Wedge { opening_rad: TAU, reflectance: [gain; 2] };
    // From the wall's face, which hangs from an upper edge and stands on a lower one.
    let off_face_rad = plan_m.atan2(if is_upper { rise_m } else { -rise_m });
    let aspect =
        Aspect { in_rad: off_face_rad, out_rad: off_face_rad, distance_m: 0.5 * distance_m };
    let field = law.echo(&wedge, &aspect, settings.wave_number_per_m);
    let amplitude = field.norm() * beam.gain * beam.gain * settings.air_gain(length_m);
    let departure = beam.departure(run.normalize_or_zero());
    (amplitude >= settings.floor).then_some(Echo {
        length_m,
        amplitude,
        phase_rad: field.arg(),
        departure,
        arrival: departure,
        rise_rad: [rise_m.atan2(plan_m); 2],
        image: 0,
        via: Via::Rim { rim: 0 },
    })
}

impl Paths {
    /// Whether nothing stands in the straight way up or down to a rim.
    fn is_rim_clear(&self, tree: &Tree, rim: &Rim, start: DVec2, rise_m: f64) -> bool {
        let mut contacts = self.part_contacts(tree, Part::Flat(rim.leg), rim.place);
        contacts.push((rim.place, Reflector::Wall(rim.wall)));
        self.is_way_clear(&contacts, &Ends { start, end: None, rise_m })
    }
}
