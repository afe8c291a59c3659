//! Search for echoes by way of cylinders.

use super::{
    connect::{Connector, HalfPaths, MiddleContact},
    grow::TubeGrower,
    partners::Partners,
    rays::CylinderRays,
};
use crate::{
    geometry::DVec2,
    model::paths::{beams::Beams, echo::PathEcho, floor::TracingPlan, pattern::TwoWayBound},
};

/// Echoes by way of cylinders, and rays to edges.
#[derive(Default)]
pub(crate) struct CylinderEchoes {
    pub(crate) echoes: Vec<PathEcho>,
    /// Connections by number in [`Via::Cylinder`](crate::model::paths::echo::Via::Cylinder).
    pub(crate) connections: Vec<MiddleContact>,
    /// Rays from the transmitter.
    pub(crate) out: CylinderRays,
    /// Rays from the receiver, if it is at a different point.
    pub(crate) back: CylinderRays,
}

/// Finds echoes that touch cylinders, and rays by way of cylinders to edges. With `bound`, only
/// echoes that can be detected.
///
/// Both ends grow level by level in turn. Half-paths are extended as long as the last level of the
/// other end has partners for them, since an echo has as many cylinders before its middle contact
/// as after it, or one more.
pub(crate) fn trace(
    plan: &TracingPlan,
    out: &Beams,
    back: Option<&Beams>,
    [transmitter, receiver]: [DVec2; 2],
    bound: Option<&TwoWayBound>,
) -> CylinderEchoes {
    if plan.cylinders.is_empty() {
        return CylinderEchoes::default();
    }
    let mut outs = TubeGrower::new(plan, out, receiver);
    let mut backs = back.map(|beams| TubeGrower::new(plan, beams, transmitter));
    let max_path_m = plan.settings.max_path_m;
    loop {
        let partners = Partners::from_half_paths(outs.last_level(), bound, max_path_m);
        let more = match &mut backs {
            None => outs.grow(&partners),
            Some(backs) => {
                let others = Partners::from_half_paths(backs.last_level(), bound, max_path_m);
                // `|` instead of `||`: both have to grow.
                outs.grow(&others) | backs.grow(&partners)
            }
        };
        if !more {
            break;
        }
    }
    let (mut out_rays, half_paths) = outs.finish();
    let mut from_receiver = backs.map(TubeGrower::finish);
    let mut connector = Connector::new(plan, bound);
    let mut outs = HalfPaths { views: &out.to_cylinders, all: &half_paths, rays: &mut out_rays };
    let mut backs = back.zip(from_receiver.as_mut()).map(|(beams, (rays, half_paths))| HalfPaths {
        views: &beams.to_cylinders,
        all: half_paths,
        rays,
    });
    connector.connect(&mut outs, backs.as_mut());
    let Connector { connections, echoes, .. } = connector;
    let back = from_receiver.map(|(rays, _)| rays).unwrap_or_default();
    CylinderEchoes { echoes, connections, out: out_rays, back }
}
