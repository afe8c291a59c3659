//! The search for echoes by way of cylinders.

use super::{
    connect::{Connection, Connector, HalfPaths},
    grow::TubeGrower,
    partners::Partners,
    rays::CylinderRays,
};
use crate::{
    geometry::DVec2,
    model::paths::{beams::Beams, echo::Echo, pattern::TwoWayBound, plan::Plan},
};

/// Echoes by way of cylinders, and rays to edges.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) echoes: Vec<Echo>,
    /// By number in [`Via::Cylinder`](crate::model::paths::echo::Via::Cylinder).
    pub(crate) connections: Vec<Connection>,
    /// From the transmitter.
    pub(crate) out: CylinderRays,
    /// From the receiver, if it is somewhere else.
    pub(crate) back: CylinderRays,
}

/// Echoes that touch cylinders, and rays by way of them to edges. With `bound`, only echoes that can be
/// heard.
///
/// Level by level on both ends in turn: half-paths are followed on as long as the last level of the other end
/// has partners for them, for an echo has as many cylinders before its middle contact as after it, or one
/// more.
pub(crate) fn trace(
    plan: &Plan,
    out: &Beams,
    back: Option<&Beams>,
    [transmitter, receiver]: [DVec2; 2],
    bound: Option<&TwoWayBound>,
) -> Found {
    if plan.cylinders.is_empty() {
        return Found::default();
    }
    let mut outs = TubeGrower::new(plan, out, receiver);
    let mut backs = back.map(|beams| TubeGrower::new(plan, beams, transmitter));
    loop {
        let partners = Partners::of(outs.last_level(), bound);
        let more = match &mut backs {
            None => outs.grow(&partners),
            Some(backs) => {
                let others = Partners::of(backs.last_level(), bound);
                // Both, always.
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
    Found { echoes, connections, out: out_rays, back }
}
