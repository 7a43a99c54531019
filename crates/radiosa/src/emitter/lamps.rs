//! Many lights without size: some are drawn for a place by about what they give there, instead of all being looked at.
//!
//! Points and spots stand in a tree as emissive surfaces do (`tree.rs`) [ContyEstevez18]. A node knows the box around its lights, what they give before their
//! falloff, the mildest of their falloffs, and the cone their spots shine into; seen from a place its importance is
//!
//! ```text
//! I = (Φ_physical/d² + Φ_classic f(d)) cosθ
//! ```
//!
//! with the largest cosine that the box allows, and nothing where the place lies beyond every range or outside every cone. A leaf weighs its lights by what each gives,
//! exactly. Light from infinitely far is the same everywhere but for its cosine: it is drawn by that from a list.

use super::point::{Falloff, Point};
use super::tree::{Node, cos_of_difference, descend};
use super::{EVERYWHERE, Emitter, Incident};
use crate::math::{Bounds, Vec3};

/// Lights a leaf holds at most.
const LEAF: usize = 4;
/// Cosines within rounding of a limit are inside.
const ROUNDING: f32 = 1e-3;

/// Lights without size, to be drawn from.
#[derive(Debug)]
pub(crate) struct Lamps {
    nodes: Vec<Node<Reach>>,
    /// Points and spots, in the order of the leaves.
    lamps: Vec<Emitter>,
    /// What arrives everywhere.
    suns: Vec<Incident>,
}

/// Where a set of lights is and where it shines.
#[derive(Clone, Copy, Debug)]
struct Reach {
    centre: Vec3,
    /// Of the sphere around the box, m.
    radius: f32,
    /// The middle of the cone that holds all axes, the cosine of its half angle and that of the widest cutoff.
    axis: Vec3,
    cos_cone: f32,
    cos_cutoff: f32,
    /// Sums of `E_⊥` before falloff, by kind of falloff.
    physical: f32,
    classic: f32,
    /// The least of the classic constants.
    c: [f32; 3],
    /// The farthest, m.
    range: f32,
}

impl Lamps {
    /// Takes the lights out of a list that are too many to be looked at one and all, more than `few` with a place or without; `None` when none are.
    pub(crate) fn take_from(emitters: &mut Vec<Emitter>, few: usize) -> Option<Self> {
        let is_placed = |e: &Emitter| matches!(e, Emitter::Point(_) | Emitter::Spot(_));
        let is_sun = |e: &Emitter| matches!(e, Emitter::Distant(_) | Emitter::Discrete(_));
        let many =
            |is: &dyn Fn(&Emitter) -> bool| emitters.iter().filter(|e| is(e)).map(Emitter::n_directions).sum::<usize>() > few;
        let (many_placed, many_suns) = (many(&is_placed), many(&is_sun));
        if !many_placed && !many_suns {
            return None;
        }
        let (mut lamps, mut suns) = (Vec::new(), Vec::new());
        emitters.retain(|emitter| {
            let is_lamp = many_placed && is_placed(emitter);
            if is_lamp {
                lamps.push(emitter.clone());
            } else if many_suns && is_sun(emitter) {
                emitter.for_each_incident(Vec3::ZERO, &mut |incident| suns.push(incident));
                return false;
            }
            !is_lamp
        });
        let mut nodes = Vec::new();
        if !lamps.is_empty() {
            grow(&mut lamps, 0, &mut nodes);
        }
        Some(Self { nodes, lamps, suns })
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.lamps.len() + self.suns.len()
    }

    /// What arrives at `p` from each of them.
    pub(crate) fn for_each_incident(&self, p: Vec3, mut f: impl FnMut(Incident)) {
        self.lamps.iter().filter_map(|lamp| lamp.incident(p)).for_each(&mut f);
        self.suns.iter().copied().for_each(f);
    }

    /// What arrives at `p` with normal `n` ([`EVERYWHERE`] in a medium) from the light with a place that `u` in `[0, 1)` draws, over the probability of that.
    pub(crate) fn draw_lamp(&self, p: Vec3, n: Vec3, u: f64) -> Option<Incident> {
        let (leaf, u, probability) = descend(&self.nodes, u, |reach| reach.importance(p, n))?;
        let lamps = &self.lamps[leaf.at as usize..][..leaf.count as usize];
        let mut choice = Choice::new(u);
        for incident in lamps.iter().filter_map(|lamp| lamp.incident(p)) {
            choice.offer(incident, given(&incident, n));
        }
        choice.drawn(probability)
    }

    /// The same of the lights that are infinitely far.
    pub(crate) fn draw_sun(&self, n: Vec3, u: f64) -> Option<Incident> {
        let mut choice = Choice::new(u);
        for incident in &self.suns {
            choice.offer(*incident, given(incident, n));
        }
        choice.drawn(1.0)
    }
}

/// One of several lights, drawn by weight while they are looked at one after the other.
pub(crate) struct Choice {
    /// Uniform, whatever was drawn so far.
    u: f64,
    sum: f64,
    drawn: Option<(Incident, f64)>,
}

impl Choice {
    /// By a number in `[0, 1)`.
    pub(crate) fn new(u: f64) -> Self {
        Self { u, sum: 0.0, drawn: None }
    }

    /// Another one.
    pub(crate) fn offer(&mut self, incident: Incident, weight: f64) {
        if !(weight > 0.0 && weight.is_finite()) {
            return;
        }
        self.sum += weight;
        let share = weight / self.sum;
        if self.u < share {
            self.drawn = Some((incident, weight));
            self.u /= share;
        } else {
            self.u = (self.u - share) / (1.0 - share);
        }
    }

    /// What was drawn, over its probability times that of looking here.
    pub(crate) fn drawn(self, of_looking_here: f64) -> Option<Incident> {
        let (incident, weight) = self.drawn?;
        let by = (self.sum / (weight * of_looking_here)) as f32;
        by.is_finite().then(|| Incident { diffuse: incident.diffuse * by, specular: incident.specular * by, ..incident })
    }
}

/// About what a light gives a place with normal `n`.
fn given(incident: &Incident, n: Vec3) -> f64 {
    let cos = if n == EVERYWHERE { 1.0 } else { n.dot(incident.wi).max(0.0) };
    f64::from((incident.diffuse + incident.specular).luminance() * cos)
}

fn point_of(emitter: &Emitter) -> &Point {
    match emitter {
        Emitter::Point(point) => point,
        Emitter::Spot(spot) => &spot.point,
        _ => unreachable!("only points and spots stand in the tree"),
    }
}

/// Makes the nodes over some lights, which it sorts; `first` is where they stand.
fn grow(lamps: &mut [Emitter], first: usize, nodes: &mut Vec<Node<Reach>>) {
    let at = nodes.len();
    nodes.push(Node { reach: Reach::of(lamps), at: first as u32, count: lamps.len() as u32 });
    if lamps.len() <= LEAF {
        return;
    }
    let extent = Bounds::of(lamps.iter().map(|lamp| point_of(lamp).position)).extent();
    let axis = (0..3).max_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
    lamps.sort_by(|a, b| point_of(a).position[axis].total_cmp(&point_of(b).position[axis]));
    let middle = lamps.len() / 2;
    nodes[at].count = 0;
    let (a, b) = lamps.split_at_mut(middle);
    grow(a, first, nodes);
    nodes[at].at = nodes.len() as u32;
    grow(b, first + middle, nodes);
}

impl Reach {
    fn of(lamps: &[Emitter]) -> Self {
        let bounds = Bounds::of(lamps.iter().map(|lamp| point_of(lamp).position));
        // A point shines to all sides.
        let shines = |lamp: &Emitter| match lamp {
            Emitter::Spot(spot) => (spot.axis, spot.profile.cos_cutoff()),
            _ => (Vec3::ZERO, -1.0),
        };
        let axis = lamps.iter().map(|lamp| shines(lamp).0).sum::<Vec3>().normalize_or_zero();
        let mut reach = Self {
            centre: bounds.centre(),
            radius: 0.5 * bounds.extent().length(),
            axis,
            cos_cone: if axis == Vec3::ZERO { -1.0 } else { 1.0 },
            cos_cutoff: 1.0,
            physical: 0.0,
            classic: 0.0,
            c: [f32::INFINITY; 3],
            range: 0.0,
        };
        for lamp in lamps {
            let (own, cos_cutoff) = shines(lamp);
            reach.cos_cutoff = reach.cos_cutoff.min(cos_cutoff);
            reach.cos_cone = reach.cos_cone.min(own.dot(axis));
            let point = point_of(lamp);
            let power = (point.diffuse + point.specular).luminance();
            let inverse_range = match point.falloff {
                Falloff::InverseSquare { inverse_range } => {
                    reach.physical += power;
                    inverse_range
                }
                Falloff::Classic { c1, c2, c3, inverse_range } => {
                    reach.classic += power;
                    reach.c = [reach.c[0].min(c1), reach.c[1].min(c2), reach.c[2].min(c3)];
                    inverse_range
                }
            };
            reach.range = reach.range.max(1.0 / inverse_range);
        }
        if reach.cos_cutoff <= -1.0 {
            reach.cos_cone = -1.0;
        }
        reach
    }

    /// About what arrives at `p` with normal `n`; 0 only where nothing can.
    fn importance(&self, p: Vec3, n: Vec3) -> f32 {
        let to_light = self.centre - p;
        let d = to_light.length();
        let beyond = d - self.radius;
        if beyond > self.range {
            return 0.0;
        }
        // The cosine of the half angle the sphere around the box is seen under.
        let cos_box = if beyond > 0.0 { (1.0 - (self.radius / d) * (self.radius / d)).max(0.0).sqrt() } else { -1.0 };
        let wi = to_light / d.max(f32::MIN_POSITIVE);
        let cos_in = if n == EVERYWHERE { 1.0 } else { cos_of_difference(n.dot(wi), cos_box) };
        if cos_in <= -ROUNDING {
            return 0.0;
        }
        if self.cos_cone > -1.0 {
            let outside = cos_of_difference(cos_of_difference(-self.axis.dot(wi), self.cos_cone), cos_box);
            if outside < self.cos_cutoff - ROUNDING {
                return 0.0;
            }
        }
        let physical = self.physical / (d.max(self.radius) * d.max(self.radius)).max(f32::MIN_POSITIVE);
        let classic = if self.classic > 0.0 {
            let below = self.c[0] + d * (self.c[1] + d * self.c[2]);
            self.classic * if below > 1.0 { 1.0 / below } else { 1.0 }
        } else {
            0.0
        };
        ((physical + classic) * cos_in.max(ROUNDING)).min(1e30)
    }
}
