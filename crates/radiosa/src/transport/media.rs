//! Which medium a ray is in, where transparent bodies overlap: nested dielectrics by priority. Source: [Schmidt02].
//!
//! A ray carries the bodies it has entered and not left. Of those the one of the highest priority is what it travels in; of equal ones the body it
//! entered last, which is what modelling one body wholly inside another means. A boundary counts only where this changes what the ray travels in:
//! a body of lower priority inside another has no surface there, and the ray passes straight ("false intersections" in the paper). So a
//! drink may reach into its glass, and where it ends exactly does not matter.
//!
//! The bodies around the eye are found before any picture ([`Media::around`]). A ray that nevertheless leaves a body it never entered started inside it. The list is short and fixed; a body that does not fit is treated as never entered,
//! which is a wrong index where more than [`CAPACITY`] bodies overlap and nothing worse.

use super::{Surface, World};
use crate::bsdf::Transmission;
use crate::math::{Ray, Vec3, function};
use crate::scene::{self, MaterialId};
use crate::spectrum::Spectrum;

/// Bodies that may overlap in one place.
pub(crate) const CAPACITY: usize = 6;

/// Surfaces passed at most on the way out of the bodies around a point.
const SURFACES_MAX: u32 = 256;
/// Axes along which bodies around a point are looked for: askew to everything that is built at right angles.
const AXES: [Vec3; 3] = [Vec3::new(0.613, 0.718, 0.331), Vec3::new(-0.447, 0.209, 0.870), Vec3::new(0.769, -0.564, 0.302)];

/// A transparent body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Medium {
    /// Which: instance and material, since one mesh may hold several bodies.
    pub(crate) body: (u32, u32),
    /// Index of refraction in vacuum.
    pub(crate) ior: f32,
    /// σ, 1/m.
    pub(crate) absorption: Spectrum,
    /// The highest wins.
    pub(crate) priority: i32,
}

impl Medium {
    /// The body whose surface this is.
    pub(crate) fn of(surface: &Surface, transmission: &Transmission) -> Self {
        let material = surface.material.map_or(u32::MAX, |m| m.0);
        let Transmission { ior, absorption, priority, .. } = *transmission;
        Self { body: (surface.instance.0, material), ior, absorption, priority }
    }
}

/// What takes light away between surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loss {
    /// What bodies absorb: to methods that know no scattering everything else is clear.
    Absorption,
    /// Whatever takes light out of its direction, absorbing or scattering it: in bodies, and in what fills the scene around them.
    Extinction,
}

/// The bodies a ray is in, in the order it entered them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Media {
    bodies: [Medium; CAPACITY],
    n: usize,
}

/// What a ray finds at the surface of a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Boundary {
    /// Index of refraction on the other side of the body's surface; `None` when another body of higher priority hides this one.
    pub(crate) surroundings: Option<f32>,
    /// The medium it came through when that is the body itself and it never entered: it started inside.
    pub(crate) began_in: Option<Medium>,
}

impl Media {
    /// In none.
    pub(crate) const VACUUM: Self =
        Self { bodies: [Medium { body: (0, 0), ior: 1.0, absorption: Spectrum::BLACK, priority: 0 }; CAPACITY], n: 0 };

    /// The bodies around a point: those that rays leave in six directions without having entered them. What is open on some side is no body.
    ///
    /// A ray leaves the innermost body first, which is the one entered last.
    pub(crate) fn around(world: &World, p: Vec3) -> Self {
        let mut directions = AXES.iter().flat_map(|axis| [*axis, -*axis]).map(|dir| left_behind(world, p, dir.normalize()));
        let mut bodies = directions.next().unwrap_or_default();
        for mut others in directions {
            let mut is_left = |body: &Medium| {
                let i = others.iter().position(|other| other.body == body.body);
                i.map(|i| others.swap_remove(i)).is_some()
            };
            bodies.retain(&mut is_left);
        }
        let mut media = Self::VACUUM;
        for body in bodies.into_iter().take(CAPACITY).rev() {
            media.pass(body, true);
        }
        media
    }

    /// Passes every surface on the straight way from one point to another.
    pub(crate) fn go(&mut self, world: &World, from: Vec3, to: Vec3) {
        walk(world, Ray { origin: from, dir: to - from, t_max: 1.0 }, |body, entering| {
            self.pass(body, entering);
        });
    }

    /// What the ray travels in; `None` for vacuum.
    pub(crate) fn current(&self) -> Option<&Medium> {
        // The last of equal ones.
        self.bodies[..self.n].iter().max_by_key(|body| body.priority)
    }

    /// Its index of refraction.
    pub(crate) fn ior(&self) -> f32 {
        self.current().map_or(1.0, |medium| medium.ior)
    }

    /// The ray passes the surface of `body`, from outside (`entering`) or from inside.
    pub(crate) fn pass(&mut self, body: Medium, entering: bool) -> Boundary {
        if entering {
            let hidden = self.current().is_some_and(|current| current.priority > body.priority);
            let surroundings = (!hidden).then(|| self.ior());
            if self.n < CAPACITY {
                self.bodies[self.n] = body;
                self.n += 1;
            }
            return Boundary { surroundings, began_in: None };
        }
        let Some(i) = self.bodies[..self.n].iter().rposition(|other| other.body == body.body) else {
            let hidden = self.current().is_some_and(|current| current.priority > body.priority);
            return Boundary { surroundings: (!hidden).then(|| self.ior()), began_in: (!hidden).then_some(body) };
        };
        let visible = self.current().is_some_and(|current| current.body == body.body);
        self.bodies.copy_within(i + 1..self.n, i);
        self.n -= 1;
        Boundary { surroundings: visible.then(|| self.ior()), began_in: None }
    }
}

/// The bodies a ray leaves without having entered them, in that order.
fn left_behind(world: &World, p: Vec3, dir: Vec3) -> Vec<Medium> {
    let (mut entered, mut left) = (Vec::new(), Vec::new());
    walk(world, Ray::new(p, dir), |body, entering| {
        if entering {
            entered.push(body.body);
        } else if let Some(i) = entered.iter().rposition(|other| *other == body.body) {
            entered.remove(i);
        } else {
            left.push(body);
        }
    });
    left
}

/// Calls `pass` with each surface of a body along a ray, and whether the ray enters there; nothing else stops it.
fn walk(world: &World, ray: Ray, mut pass: impl FnMut(Medium, bool)) {
    let wo = -ray.dir.normalize_or(Vec3::Y);
    let end = ray.t_max.is_finite().then(|| ray.origin + ray.dir * ray.t_max);
    let mut onward = ray;
    for _ in 0..SURFACES_MAX {
        let Some((_, surface)) = world.closest_visible(&onward) else { return };
        if let Some(t) = world.shading(&surface, wo).bsdf.transmission().filter(|t| !t.thin) {
            pass(Medium::of(&surface, &t), surface.is_front(wo));
        }
        onward = end.map_or_else(|| surface.ray(ray.dir), |end| surface.segment_to(end));
        if onward.dir.dot(ray.dir) <= 0.0 {
            return;
        }
    }
}

/// What is left of light after `distance` metres in a medium, or in none.
pub(crate) fn transmittance_of(medium: Option<&Medium>, distance: f32) -> Spectrum {
    medium.map_or(Spectrum::WHITE, |medium| transmittance(medium.absorption, distance))
}

/// What fills the space a ray is in, in a body or around them; `None` where nothing does.
pub(crate) fn filling(world: &World, body: Option<&Medium>) -> Option<scene::Medium> {
    match body {
        Some(body) => world.material((body.body.1 != u32::MAX).then_some(MaterialId(body.body.1))).medium(),
        None => world.scene().medium,
    }
}

/// What is left of light after `distance` metres in a body, or around them.
pub(crate) fn left(world: &World, body: Option<&Medium>, loss: Loss, distance: f32) -> Spectrum {
    match loss {
        Loss::Absorption => transmittance_of(body, distance),
        Loss::Extinction => filling(world, body).map_or(Spectrum::WHITE, |medium| transmittance(medium.extinction(), distance)),
    }
}

/// What is left of light after `distance` metres: `exp(−σ d)` by channel (Beer's law). Nothing comes from infinitely far.
pub(crate) fn transmittance(absorption: Spectrum, distance: f32) -> Spectrum {
    absorption.map(|sigma| if sigma > 0.0 { function::exp(-sigma * distance) } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(id: u32, ior: f32, priority: i32) -> Medium {
        Medium { body: (id, 0), ior, priority, ..Medium::default() }
    }

    #[test]
    fn the_higher_priority_hides_the_lower_where_bodies_overlap() {
        let (glass, water) = (body(1, 1.5, 2), body(2, 1.33, 1));
        // Into the glass, the water begins unseen within it, out of the glass into water, out of the water.
        let mut media = Media::VACUUM;
        let mut pass = |body, entering| (media.pass(body, entering).surroundings, media.ior());
        assert_eq!(pass(glass, true), (Some(1.0), 1.5));
        assert_eq!(pass(water, true), (None, 1.5));
        assert_eq!(pass(glass, false), (Some(1.33), 1.33));
        assert_eq!(pass(water, false), (Some(1.0), 1.0));
    }

    #[test]
    fn of_equal_bodies_the_inner_one_counts() {
        let (block, bubble) = (body(1, 1.5, 0), body(2, 1.0, 0));
        let mut media = Media::VACUUM;
        media.pass(block, true);
        let mut pass = |body, entering| (media.pass(body, entering).surroundings, media.ior());
        assert_eq!(pass(bubble, true), (Some(1.5), 1.0));
        assert_eq!(pass(bubble, false), (Some(1.5), 1.5));
    }

    #[test]
    fn a_ray_that_leaves_what_it_never_entered_began_inside() {
        let (glass, mut media) = (body(1, 1.5, 0), Media::VACUUM);
        let out = media.pass(glass, false);
        assert_eq!((out.surroundings, out.began_in, media.ior()), (Some(1.0), Some(glass), 1.0));
    }

    #[test]
    fn more_bodies_than_fit_do_no_harm() {
        let mut media = Media::VACUUM;
        for i in 0..3 * CAPACITY as u32 {
            media.pass(body(i, 1.0 + i as f32, 0), true);
        }
        for i in (0..3 * CAPACITY as u32).rev() {
            media.pass(body(i, 1.0 + i as f32, 0), false);
        }
        assert_eq!((media.n, media.ior()), (0, 1.0));
    }
}
