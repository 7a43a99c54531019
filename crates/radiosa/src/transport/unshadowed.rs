//! Direct light without shadows, for eight points at a time: the sums of [`Lights::at`], in lanes.
//!
//! Points are queued by their reflection model, and lit when eight of one model are there. What does not depend on the light is taken out of the
//! sums. For Phong, `k_d` and `k_s` multiply sums over the lights of `E f (n·l)/π` and `E f lobe/π`. For metallic–roughness, Schlick's reflectance is
//! `A + (B − A)(1 − v·h)⁵`, so that two sums over the lights suffice, of `E q` and `E q (1 − v·h)⁵`, `q = D G/(4 n·v)`.
//! Cook–Torrance is lit point by point.
//!
//! `tests/scanline.rs` holds it against [`Lights::at`].

use std::f32::consts::FRAC_1_PI;

use super::{Lights, LocalLight, Shading, Surface, World};
use crate::bsdf::{Bsdf, metallic_roughness::MetallicRoughness, phong::Phong};
use crate::emitter::Emitter;
use crate::emitter::point::Falloff;
use crate::emitter::spot::Profile;
use crate::math::Vec3;
use crate::math::lanes::{Cpu, Ints, Lanes, for_each_cpu};
use crate::radiometry::lambertian_radiance;
use crate::scene::PhongLobe;
use crate::spectrum::Spectrum;

/// Columns of three.
type Rgb8 = [[f32; 8]; 3];

/// The models that are lit in lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Model {
    Phong,
    Blinn,
    MetallicRoughness,
}

/// Up to eight points of one model.
#[derive(Clone, Debug)]
struct Batch {
    n_points: usize,
    id: [u32; 8],
    p: Rgb8,
    n: Rgb8,
    wo: Rgb8,
    /// Phong: the exponent; metallic–roughness: α², zero where smooth.
    sharpness: [f32; 8],
    /// Metallic–roughness: strength of the coat, and its largest `F₀`.
    coat: [f32; 8],
    f0: [f32; 8],
    /// What the sums are multiplied by: the diffuse one, and the one or two specular ones.
    by: [[Spectrum; 3]; 8],
}

/// Sums over the lights.
struct Sums {
    diffuse: Rgb8,
    specular: [Rgb8; 2],
}

/// Points waiting for light, and the light of those that waited long enough.
#[derive(Debug)]
pub struct Unshadowed<'a> {
    world: &'a World,
    lights: &'a Lights,
    batches: [Batch; 3],
    /// By the number a point was given.
    lit: Vec<LocalLight>,
}

impl<'a> Unshadowed<'a> {
    /// Nothing waits.
    pub fn new(world: &'a World, lights: &'a Lights) -> Self {
        Self { world, lights, batches: std::array::from_fn(|_| Batch::new()), lit: Vec::new() }
    }

    /// Forgets all points.
    pub fn clear(&mut self) {
        self.lit.clear();
        self.batches.iter_mut().for_each(|b| b.n_points = 0);
    }

    /// How many points were added: the number of the next one.
    pub fn n_points(&self) -> u32 {
        self.lit.len() as u32
    }

    /// Adds a point; its number is how many were added before.
    pub fn push(&mut self, surface: &Surface, shading: &Shading) {
        let id = self.lit.len() as u32;
        let ambient = shading.bsdf.ambient() * self.lights.ambient();
        self.lit.push(LocalLight { ambient, ..LocalLight::default() });
        let model = match &shading.bsdf {
            Bsdf::Unlit(_) => return,
            Bsdf::CookTorrance(_) => {
                self.lit[id as usize] = self.lights.at(self.world, surface, shading, false, &mut 0);
                return;
            }
            Bsdf::Phong(m) => {
                let model = if m.lobe == PhongLobe::Phong { Model::Phong } else { Model::Blinn };
                self.batches[model as usize].phong(m);
                model
            }
            Bsdf::MetallicRoughness(m) => {
                self.batches[Model::MetallicRoughness as usize].metallic_roughness(m);
                Model::MetallicRoughness
            }
        };
        let batch = &mut self.batches[model as usize];
        batch.place(id, surface.p, shading.n, shading.wo);
        if batch.n_points == 8 {
            self.flush(model);
        }
    }

    /// Lights what still waits; the light of every point by its number.
    pub fn finish(&mut self) -> &[LocalLight] {
        for model in [Model::Phong, Model::Blinn, Model::MetallicRoughness] {
            if self.batches[model as usize].n_points > 0 {
                self.flush(model);
            }
        }
        &self.lit
    }

    fn flush(&mut self, model: Model) {
        let batch = &mut self.batches[model as usize];
        batch.fill_up();
        let mut sums = Sums { diffuse: [[0.0; 8]; 3], specular: [[[0.0; 8]; 3]; 2] };
        light(self.world.cpu_path(), batch, model, self.lights.emitters(), &mut sums);
        for i in 0..batch.n_points {
            let at = |c: &Rgb8| Spectrum::new(c[0][i], c[1][i], c[2][i]);
            let [diffuse, a, b] = batch.by[i];
            let light = &mut self.lit[batch.id[i] as usize];
            light.diffuse = diffuse * at(&sums.diffuse);
            light.specular = a * at(&sums.specular[0]) + b * at(&sums.specular[1]);
        }
        batch.n_points = 0;
    }
}

impl Batch {
    fn new() -> Self {
        Self {
            n_points: 0,
            id: [0; 8],
            p: [[0.0; 8]; 3],
            n: [[0.0; 8]; 3],
            wo: [[0.0; 8]; 3],
            sharpness: [0.0; 8],
            coat: [0.0; 8],
            f0: [0.0; 8],
            by: [[Spectrum::BLACK; 3]; 8],
        }
    }

    fn phong(&mut self, m: &Phong) {
        let i = self.n_points;
        self.sharpness[i] = m.exponent;
        self.by[i] = [m.diffuse, m.specular, Spectrum::BLACK];
    }

    fn metallic_roughness(&mut self, m: &MetallicRoughness) {
        let i = self.n_points;
        self.sharpness[i] = if m.is_smooth() { 0.0 } else { m.alpha * m.alpha };
        (self.coat[i], self.f0[i]) = (m.specular, m.f0.max_channel());
        let coat = (1.0 - m.metallic) * m.specular;
        let straight = m.f0 * coat + m.base_color * m.metallic;
        let grazing = Spectrum::gray(coat + m.metallic);
        self.by[i] = [m.base_color * ((1.0 - m.metallic) * (1.0 - m.transmission)), straight, grazing - straight];
    }

    fn place(&mut self, id: u32, p: Vec3, n: Vec3, wo: Vec3) {
        let i = self.n_points;
        self.id[i] = id;
        for k in 0..3 {
            (self.p[k][i], self.n[k][i], self.wo[k][i]) = (p[k], n[k], wo[k]);
        }
        self.n_points += 1;
    }

    /// Copies the first point to the places that are free: every lane holds something ordinary.
    fn fill_up(&mut self) {
        for i in self.n_points..8 {
            for column in self.p.iter_mut().chain(&mut self.n).chain(&mut self.wo) {
                column[i] = column[0];
            }
            (self.sharpness[i], self.coat[i], self.f0[i]) = (self.sharpness[0], self.coat[0], self.f0[0]);
        }
    }
}

for_each_cpu! {
    fn light(batch: &Batch, model: Model, emitters: &[Emitter], sums: &mut Sums) = light_on;
}

type V3<L> = [L; 3];

#[inline(always)]
fn dot<L: Lanes>(a: V3<L>, b: V3<L>) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

#[inline(always)]
fn splat3<L: Lanes>(v: Vec3) -> V3<L> {
    [L::splat(v.x), L::splat(v.y), L::splat(v.z)]
}

#[inline(always)]
fn load3<L: Lanes>(v: &Rgb8) -> V3<L> {
    [L::load(&v[0]), L::load(&v[1]), L::load(&v[2])]
}

/// Eight points under one light after the other.
struct Points<L> {
    model: Model,
    p: V3<L>,
    n: V3<L>,
    wo: V3<L>,
    n_v: L,
    sharpness: L,
    coat: L,
    f0: L,
    diffuse: V3<L>,
    specular: [V3<L>; 2],
}

#[inline(always)]
fn light_on<C: Cpu>(batch: &Batch, model: Model, emitters: &[Emitter], sums: &mut Sums) {
    let zero = C::Wide::splat(0.0);
    let (n, wo) = (load3(&batch.n), load3(&batch.wo));
    let mut points = Points::<C::Wide> {
        model,
        p: load3(&batch.p),
        n,
        wo,
        n_v: dot(n, wo),
        sharpness: C::Wide::load(&batch.sharpness),
        coat: C::Wide::load(&batch.coat),
        f0: C::Wide::load(&batch.f0),
        diffuse: [zero; 3],
        specular: [[zero; 3]; 2],
    };
    let one = C::Wide::splat(1.0);
    for emitter in emitters {
        match emitter {
            Emitter::Ambient(_) => {}
            Emitter::Hemispherical(_) | Emitter::Environment(_) => without_direction(&mut points, batch, emitter),
            Emitter::Point(l) => {
                let (wi, d, there) = points.towards(l.position);
                points.add(wi, falloff(l.falloff, d), there, l.diffuse, l.specular);
            }
            Emitter::Spot(l) => {
                let (wi, d, there) = points.towards(l.point.position);
                let f = falloff(l.point.falloff, d).mul(profile(l.profile, splat3(l.axis), wi));
                points.add(wi, f, there, l.point.diffuse, l.point.specular);
            }
            Emitter::Distant(l) => points.add(splat3(l.to_light), one, zero.le(one), l.diffuse, l.specular),
            Emitter::Discrete(l) => {
                for i in &l.incidents {
                    points.add(splat3(i.wi), one, zero.le(one), i.diffuse, i.specular);
                }
            }
            Emitter::Area(l) => {
                for s in &l.samples {
                    let (wi, d, there) = points.towards(s.position);
                    let cos = dot(splat3(s.normal), wi).neg();
                    let cos = if s.two_sided { cos.abs() } else { cos };
                    let f = C::Wide::splat(s.area).mul(cos).div(d).div(d);
                    points.add(wi, f, there, s.radiance, s.radiance);
                }
            }
        }
    }
    for k in 0..3 {
        sums.diffuse[k] = points.diffuse[k].store();
        sums.specular[0][k] = points.specular[0][k].store();
        sums.specular[1][k] = points.specular[1][k].store();
    }
}

/// Irradiance from everywhere at once, lane by lane: the diffuse lobe as seen head-on.
#[inline(always)]
fn without_direction<L: Lanes>(points: &mut Points<L>, batch: &Batch, emitter: &Emitter) {
    let coat = |i: usize| if points.model == Model::MetallicRoughness { 1.0 - batch.coat[i] * batch.f0[i] } else { 1.0 };
    let light: [[f32; 3]; 8] = std::array::from_fn(|i| {
        let n = Vec3::new(batch.n[0][i], batch.n[1][i], batch.n[2][i]);
        lambertian_radiance(Spectrum::gray(coat(i)), emitter.irradiance(n)).to_array()
    });
    for (k, sum) in points.diffuse.iter_mut().enumerate() {
        *sum = sum.add(L::load(&light.map(|l| l[k])));
    }
}
impl<L: Lanes> Points<L> {
    /// Unit direction and distance to a place, and whether there is one.
    #[inline(always)]
    fn towards(&self, place: Vec3) -> (V3<L>, L, L::Mask) {
        let place = splat3::<L>(place);
        let to = [place[0].sub(self.p[0]), place[1].sub(self.p[1]), place[2].sub(self.p[2])];
        let d = dot(to, to).sqrt();
        let inverse = L::splat(1.0).div(d);
        ([to[0].mul(inverse), to[1].mul(inverse), to[2].mul(inverse)], d, L::splat(0.0).lt(d))
    }

    /// Adds a light from `wi` of irradiance `f` times `E` where `there`.
    #[inline(always)]
    fn add(&mut self, wi: V3<L>, f: L, there: L::Mask, diffuse: Spectrum, specular: Spectrum) {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let n_l = dot(self.n, wi);
        // Neither at the light itself nor so near that f32 overflows.
        let sound = L::both(zero.lt(f), f.le(L::splat(f32::MAX)));
        let lit = L::both(L::both(there, zero.lt(n_l)), sound);
        if L::bits(lit) == 0 {
            return;
        }
        let (mut d, mut s);
        d = f.mul(n_l).mul(L::splat(FRAC_1_PI));
        let mut grazing = zero;
        match self.model {
            Model::Phong => {
                // r·v = 2 (n·l)(n·v) − l·v.
                let r_v = n_l.add(n_l).mul(self.n_v).sub(dot(wi, self.wo));
                s = f.mul(L::splat(FRAC_1_PI)).mul(power(r_v, self.sharpness));
            }
            Model::Blinn => {
                let h = [wi[0].add(self.wo[0]), wi[1].add(self.wo[1]), wi[2].add(self.wo[2])];
                let length = dot(h, h).sqrt();
                let n_h = L::select(zero.lt(length), dot(self.n, h).div(length), zero);
                s = f.mul(L::splat(FRAC_1_PI)).mul(power(n_h, self.sharpness));
            }
            Model::MetallicRoughness => {
                let h = [wi[0].add(self.wo[0]), wi[1].add(self.wo[1]), wi[2].add(self.wo[2])];
                let inverse = one.div(dot(h, h).sqrt());
                let h = [h[0].mul(inverse), h[1].mul(inverse), h[2].mul(inverse)];
                let in_front = zero.lt(self.n_v);
                let n_h = dot(self.n, h).min(one);
                let v_h = dot(self.wo, h).max(zero).min(one);
                let m = one.sub(v_h);
                let m2 = m.mul(m);
                let m5 = L::select(in_front, m2.mul(m2).mul(m), zero);
                let coat = self.f0.add(one.sub(self.f0).mul(m5)).mul(self.coat);
                d = d.mul(one.sub(coat));
                // sin² between n and h from their cross product: 1 − cos² would lose the width of sharp highlights.
                let n = self.n;
                let cross =
                    [n[1].mul(h[2]).sub(n[2].mul(h[1])), n[2].mul(h[0]).sub(n[0].mul(h[2])), n[0].mul(h[1]).sub(n[1].mul(h[0]))];
                let a2 = self.sharpness;
                // cos² (α² + tan²).
                let t = n_h.mul(n_h).mul(a2).add(dot(cross, cross));
                let distribution = a2.mul(L::splat(FRAC_1_PI)).div(t.mul(t));
                let scaled = |cos: L| cos.mul(cos).add(a2.mul(one.sub(cos).mul(one.add(cos)).max(zero))).sqrt();
                let g = L::splat(2.0).div(n_l.mul(scaled(self.n_v)).add(self.n_v.mul(scaled(n_l))));
                let q = L::splat(0.25).mul(distribution).mul(g).mul(n_l).mul(f);
                s = L::select(L::both(in_front, zero.lt(a2)), q, zero);
                grazing = m5;
            }
        }
        d = L::select(lit, d, zero);
        s = L::select(lit, s, zero);
        grazing = s.mul(L::select(lit, grazing, zero));
        let (e_d, e_s) = (diffuse.to_array(), specular.to_array());
        for k in 0..3 {
            self.diffuse[k] = self.diffuse[k].add(d.mul(L::splat(e_d[k])));
            self.specular[0][k] = self.specular[0][k].add(s.mul(L::splat(e_s[k])));
            self.specular[1][k] = self.specular[1][k].add(grazing.mul(L::splat(e_s[k])));
        }
    }
}

#[inline(always)]
fn smooth_end<L: Lanes>(x: L) -> L {
    let x2 = x.mul(x);
    L::splat(1.0).sub(x2.mul(x2)).max(L::splat(0.0))
}

/// As [`Falloff::at`].
#[inline(always)]
fn falloff<L: Lanes>(falloff: Falloff, d: L) -> L {
    match falloff {
        Falloff::Classic { c1, c2, c3, inverse_range } => {
            let denominator = L::splat(c1).add(d.mul(L::splat(c2).add(d.mul(L::splat(c3)))));
            smooth_end(d.mul(L::splat(inverse_range))).div(denominator.max(L::splat(1.0)))
        }
        Falloff::InverseSquare { inverse_range } => smooth_end(d.mul(L::splat(inverse_range))).div(d.mul(d)),
    }
}

/// As [`Profile::at`], towards `-wi`.
#[inline(always)]
fn profile<L: Lanes>(profile: Profile, axis: V3<L>, wi: V3<L>) -> L {
    let apart = [axis[0].add(wi[0]), axis[1].add(wi[1]), axis[2].add(wi[2])];
    let q = L::splat(0.5).mul(dot(apart, apart));
    match profile {
        Profile::Classic { exponent, q_cutoff } => {
            let inside = q.le(L::splat(q_cutoff));
            // Without an exponent the cone is uniform, beyond the right angle too.
            let factor = if exponent == 0.0 { L::splat(1.0) } else { power(L::splat(1.0).sub(q), L::splat(exponent)) };
            L::select(inside, factor, L::splat(0.0))
        }
        Profile::Gltf { q_outer, scale } => {
            let a = L::splat(q_outer).sub(q).mul(L::splat(scale)).max(L::splat(0.0)).min(L::splat(1.0));
            a.mul(a)
        }
    }
}

/// `x^y`, zero for `x ≤ 0`; x at most 1, y zero or above. The relative error is a few times 1e-7, times y where x is far from 1.
///
/// `log₂ x = e + (2/ln 2) artanh((m − 1)/(m + 1))` with `x = m 2^e`, m around 1, and `2^z` by its series around the nearest whole number.
#[inline(always)]
fn power<L: Lanes>(x: L, y: L) -> L {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let positive = zero.lt(x);
    let x = x.min(one).max(L::splat(f32::MIN_POSITIVE));
    // Mantissas in [√½, √2): the offset carries those above √2 into the next exponent.
    let offset = L::Int::splat(0x3F35_04F3);
    let bits = x.to_bits().sub(offset);
    let exponent = bits.shift_right::<23>();
    let m = L::from_bits(bits.sub(exponent.shift_left::<23>()).add(offset));
    let s = m.sub(one).div(m.add(one));
    let s2 = s.mul(s);
    let series = L::splat(1.0 / 9.0).mul(s2).add(L::splat(1.0 / 7.0)).mul(s2).add(L::splat(0.2)).mul(s2).add(L::splat(1.0 / 3.0));
    let log2 = s.mul(s2).mul(series).add(s).mul(L::splat(2.0 * std::f32::consts::LOG2_E)).add(L::of_ints(exponent));
    let z = log2.mul(y).max(L::splat(-126.0));
    let whole = z.round();
    let r = z.sub(L::of_ints(whole)).mul(L::splat(std::f32::consts::LN_2));
    let mut e = L::splat(1.0 / 720.0);
    for c in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        e = e.mul(r).add(L::splat(c));
    }
    let scaled = L::from_bits(e.to_bits().add(whole.shift_left::<23>()));
    L::select(positive, scaled, zero)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::Portable;

    #[test]
    fn the_power_is_that_of_the_scalar_twin() {
        type L = <Portable as Cpu>::Wide;
        for y in [0.0f32, 0.5, 1.0, 20.0, 400.0, 5000.0] {
            for i in 0..=1000 {
                let x = i as f32 / 1000.0;
                let ours = power(L::splat(x), L::splat(y)).store()[0];
                let theirs = if x > 0.0 { crate::math::function::pow(x, y) } else { 0.0 };
                assert!((ours - theirs).abs() <= theirs * 2e-6 * (1.0 + y * (1.0 - x)) + 1e-37, "{x}^{y}: {ours} {theirs}");
            }
        }
    }
}
