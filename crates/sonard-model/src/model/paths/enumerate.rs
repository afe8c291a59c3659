//! Enumeration of the echo paths of an observation point: runs every mechanism in turn.

use super::{
    beams::Beams,
    cylinders,
    diffraction::{double, level, single},
    echo::{PathEcho, Via, sorted},
    floor::ALL_SLOPES,
    height::VerticalImage,
    interactions::EchoPath,
    pattern::TwoWayBound,
    prepare::Paths,
    rays::Rays,
    scattering,
    traced::Traced,
};
use crate::{
    acoustics::edge::EdgeLaw,
    geometry::DVec2,
    model::{SearchPart, TooCostly},
};

impl Paths {
    /// Returns all echo paths of an observation point, shortest first.
    ///
    /// # Errors
    /// When there are too many.
    pub fn enumerate(&self, position: DVec2) -> Result<Vec<EchoPath>, TooCostly> {
        self.enumerate_between(position, position)
    }

    /// Returns all echo paths from a transmitter to a receiver, shortest first, without the direct
    /// path from one to the other.
    ///
    /// # Errors
    /// When there are too many.
    pub fn enumerate_between(
        &self,
        transmitter: DVec2,
        receiver: DVec2,
    ) -> Result<Vec<EchoPath>, TooCostly> {
        self.visit_between(transmitter, receiver, |paths| paths.collect())
    }

    /// Passes an iterator over all echo paths from a transmitter to a receiver to `visit`, shortest
    /// first. Each full path exists only while it is visited.
    ///
    /// # Errors
    /// When there are too many.
    pub fn visit_between<T>(
        &self,
        transmitter: DVec2,
        receiver: DVec2,
        visit: impl FnOnce(&mut dyn ExactSizeIterator<Item = EchoPath>) -> T,
    ) -> Result<T, TooCostly> {
        let (traced, echoes) = self.trace(transmitter, receiver, None)?;
        Ok(visit(&mut echoes.iter().map(|echo| self.path(&traced, echo))))
    }

    /// Searches for echo paths and returns them with the rays they are reconstructed from. With
    /// `bound`, only detectable echoes by cylinders are included.
    pub(super) fn trace(
        &self,
        transmitter: DVec2,
        receiver: DVec2,
        bound: Option<&TwoWayBound>,
    ) -> Result<(Traced, Vec<PathEcho>), TooCostly> {
        let search = Self { plan: self.plan.for_search(self.bound), ..self.clone() };
        let found = search.trace_all(transmitter, receiver, bound);
        let settings = &self.plan.settings;
        search.plan.effort.check(settings).and(self.edge_to_edge.effort.check(settings))?;
        Ok(found)
    }

    pub(super) fn trace_all(
        &self,
        transmitter: DVec2,
        receiver: DVec2,
        bound: Option<&TwoWayBound>,
    ) -> (Traced, Vec<PathEcho>) {
        let (mut traced, mut echoes) = self.trace_plan([transmitter, receiver], bound);
        if let Some(law) = self.plan.settings.edge_law {
            self.add_diffraction(law, &mut traced, &mut echoes);
        }
        self.add_images(&traced, &mut echoes);
        self.retain_allowed(&traced, &mut echoes);
        self.retain_clear(&traced, &mut echoes);
        if let Some(law) = self.plan.settings.edge_law {
            self.add_level_edges(law, &mut traced, &mut echoes);
        }
        (traced, sorted(&echoes))
    }

    /// Finds echoes in the plan without diffraction: over walls alone, off rough walls and by way
    /// of cylinders.
    fn trace_plan(&self, ends: [DVec2; 2], bound: Option<&TwoWayBound>) -> (Traced, Vec<PathEcho>) {
        let plan = &self.plan;
        let [transmitter, receiver] = ends;
        let mut out = Beams::grow(plan, transmitter, receiver);
        let mut echoes = self.mirrored(&out);
        // Rays back, traced from the receiver, are needed by edges and cylinders only.
        let needs_back = plan.settings.edge_law.is_some() || !plan.cylinders.is_empty();
        let apart = transmitter != receiver;
        let back = (apart && needs_back).then(|| Beams::grow(plan, receiver, transmitter));
        let rough = std::mem::take(&mut out.on_rough_walls);
        let (scattered, patches) =
            if apart { Default::default() } else { scattering::echoes(plan, &rough) };
        echoes.extend(scattered);
        let found = cylinders::trace(plan, &out, back.as_ref(), ends, bound);
        echoes.extend(found.echoes);
        let traced = Traced {
            ends,
            out: Rays { beams: out, cylinders: found.out },
            back: back.map(|beams| Rays { beams, cylinders: found.back }),
            connections: found.connections,
            patches,
            double: Vec::new(),
            level: Vec::new(),
        };
        (traced, echoes)
    }

    /// Returns the echoes over walls alone.
    fn mirrored(&self, beams: &Beams) -> Vec<PathEcho> {
        let settings = &self.plan.settings;
        beams
            .to_receiver
            .iter()
            .map(|ray| PathEcho {
                length_m: ray.run.length(),
                amplitude: ray.gain * settings.air_gain(ray.run.length()),
                phase_rad: 0.0,
                departure: ray.departure,
                arrival: -ray.run.normalize_or_zero(),
                rise_rad: [0.0; 2],
                image: 0,
                slopes: [ray.slopes, ALL_SLOPES],
                is_repeated: false,
                via: Via::Walls { node: ray.node },
            })
            .filter(|echo| echo.amplitude >= settings.floor)
            .collect()
    }

    /// Adds the echoes by one or two upright edges.
    fn add_diffraction(&self, law: EdgeLaw, traced: &mut Traced, echoes: &mut Vec<PathEcho>) {
        traced.out.sort_by_edge();
        traced.back.iter_mut().for_each(Rays::sort_by_edge);
        let (out, back) = (&traced.out, traced.back.as_ref());
        let mirrored = single::Mirrored::new(echoes);
        let found = single::echoes(&self.plan, law, out, back, &mirrored);
        echoes.extend(found);
        let (found, paths) = double::echoes(&self.plan, &self.edge_to_edge, law, out, back);
        echoes.extend(found);
        traced.double = paths;
    }

    /// Adds each echo of the plan by way of floor and ceiling, and the echoes of these alone.
    fn add_images(&self, traced: &Traced, echoes: &mut Vec<PathEcho>) {
        let [transmitter, receiver] = traced.ends;
        let settings = &self.plan.settings;
        let plan = echoes.len();
        for (image, index) in self.heights.images.iter().zip(1..) {
            let before = echoes.len();
            if !self.plan.effort.step(SearchPart::Images, plan) {
                return;
            }
            for at in 0..plan {
                if traced.can_climb(&echoes[at], image) {
                    echoes.extend(image.echo(&echoes[at], index, settings));
                }
            }
            // The direct path, if requested, is one of the plan's echoes.
            if !settings.direct || transmitter == receiver {
                echoes.extend(image.upright_echo(index, receiver - transmitter, settings));
            }
            self.plan.effort.keep::<PathEcho>(echoes.len() - before);
        }
        let mut number = 0;
        echoes.retain(|echo| {
            number += 1;
            let floor = || settings.contact_floor(echo.is_repeated, echo.length_m);
            let is_listed =
                || traced.can_climb(echo, &VerticalImage::NONE) && echo.amplitude >= floor();
            number > plan || is_listed()
        });
    }

    /// Adds the echoes by level edges, which have their own images by floor and ceiling.
    fn add_level_edges(&self, law: EdgeLaw, traced: &mut Traced, echoes: &mut Vec<PathEcho>) {
        let lit = |rays: &mut Rays| std::mem::take(&mut rays.beams.below_level_edges);
        let (out_lit, back_lit) = (lit(&mut traced.out), traced.back.as_mut().map(lit));
        let [transmitter, receiver] = traced.ends;
        let out = level::LevelEdgeBeams::new(transmitter, &traced.out.beams, out_lit);
        let back = traced.back.as_ref().zip(back_lit);
        let back =
            back.map(|(Rays { beams, .. }, lit)| level::LevelEdgeBeams::new(receiver, beams, lit));
        let scene = level::LevelScene { plan: &self.plan, heights: &self.heights, law };
        let (found, paths) = level::echoes(scene, &out, back.as_ref());
        echoes.extend(found);
        traced.level = paths;
    }
}
