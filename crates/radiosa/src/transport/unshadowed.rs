//! Direct light without shadows, for many points together: the sums of [`Lights::at`], in lanes.
//!
//! Points are kept in columns and lit eight at a time, those of one reflection model after those of another. What does not depend on the light is taken
//! out of the sums. For Phong, `k_d` and `k_s` multiply sums over the lights of `E f (n·l)/π` and `E f lobe/π`. For metallic–roughness, Schlick's
//! reflectance is `A + (B − A)(1 − v·h)⁵`, so that two sums over the lights suffice, of `E q` and `E q (1 − v·h)⁵`, `q = D G/(4 n·v)`.
//! Cook–Torrance is lit point by point.
//!
//! `tests/scanline.rs` holds it against [`Lights::at`].

use std::f32::consts::{FRAC_1_PI, PI};

use super::{Lights, LocalLight, Shading, Surface, World};
use crate::bsdf::Bsdf;
use crate::emitter::Emitter;
use crate::emitter::hemispherical::Hemispherical;
use crate::emitter::point::Falloff;
use crate::emitter::spot::Profile;
use crate::math::Vec3;
use crate::math::lanes::{Columns, Cpu, Ints, LANES, Lanes, V3, dot, eight, for_each_cpu, load3, splat3, xyz};
use crate::scene::PhongLobe;
use crate::spectrum::Spectrum;

/// How a point is lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Model {
    /// Not in lanes: it shows nothing, or was lit when it came.
    Done,
    /// Phong or Blinn–Phong without a highlight.
    Lambert,
    Phong,
    Blinn,
    MetallicRoughness,
}

/// A reflection function as the sums over the lights take it.
#[derive(Clone, Copy, Debug)]
struct Coefficients {
    model: Model,
    /// Phong: the exponent; metallic–roughness: α², zero where smooth.
    sharpness: f32,
    /// Metallic–roughness: strength of the coat, and its largest `F₀`.
    coat: f32,
    f0: f32,
    ambient: Spectrum,
    /// What the sums are multiplied by: the diffuse one, and the one or two specular ones.
    by: [Spectrum; 3],
}

impl Coefficients {
    fn of(bsdf: &Bsdf) -> Self {
        let (mut sharpness, mut coat, mut f0, mut by) = (0.0, 0.0, 0.0, [Spectrum::BLACK; 3]);
        let model = match bsdf {
            Bsdf::Unlit(_) | Bsdf::CookTorrance(_) => Model::Done,
            Bsdf::Phong(m) => {
                sharpness = m.exponent;
                by = [m.diffuse, m.specular, Spectrum::BLACK];
                match m.lobe {
                    _ if m.specular.is_black() => Model::Lambert,
                    PhongLobe::Phong => Model::Phong,
                    PhongLobe::BlinnPhong => Model::Blinn,
                }
            }
            Bsdf::MetallicRoughness(m) => {
                sharpness = if m.is_smooth() { 0.0 } else { m.alpha * m.alpha };
                (coat, f0) = (m.specular, m.f0.max_channel());
                let outer = (1.0 - m.metallic) * m.specular;
                let straight = m.f0 * outer + m.base_color * m.metallic;
                let grazing = Spectrum::gray(outer + m.metallic);
                by = [m.base_color * ((1.0 - m.metallic) * (1.0 - m.transmission)), straight, grazing - straight];
                Model::MetallicRoughness
            }
        };
        Self { model, sharpness, coat, f0, ambient: bsdf.ambient(), by }
    }
}

/// A reflection function whose base colour is multiplied by a tint, point by point: all its coefficients are affine in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tinted {
    black: Coefficients,
    white: Coefficients,
}

impl Tinted {
    /// Of the function as it is under a white tint; `None` where it is not lit in lanes.
    pub(crate) fn new(bsdf: &Bsdf) -> Option<Self> {
        let [black, white] = [Spectrum::BLACK, Spectrum::WHITE].map(|tint| Coefficients::of(&bsdf.tinted(tint)));
        (white.model != Model::Done).then_some(Self { black, white })
    }
}

/// Light in columns.
#[derive(Debug, Default)]
pub struct LightColumns {
    pub(crate) ambient: Columns,
    pub(crate) diffuse: Columns,
    pub(crate) specular: Columns,
}

impl LightColumns {
    /// The light of point `i`.
    pub fn at(&self, i: usize) -> LocalLight {
        let at = |c: &Columns| Spectrum::new(c[0][i], c[1][i], c[2][i]);
        LocalLight { ambient: at(&self.ambient), diffuse: at(&self.diffuse), specular: at(&self.specular) }
    }

    /// Ambient, diffuse and specular light together, for as many points as there is room for in `out`.
    pub(crate) fn sum(&self, out: &mut Columns) {
        for (k, out) in out.iter_mut().enumerate() {
            let (diffuse, specular) = (self.diffuse[k].iter(), self.specular[k].iter());
            for (out, (ambient, (diffuse, specular))) in out.iter_mut().zip(self.ambient[k].iter().zip(diffuse.zip(specular))) {
                *out = ambient + diffuse + specular;
            }
        }
    }

    /// Sets the light of point `i`.
    pub(crate) fn set(&mut self, i: usize, light: &LocalLight) {
        set3(&mut self.ambient, i, light.ambient.to_array());
        set3(&mut self.diffuse, i, light.diffuse.to_array());
        set3(&mut self.specular, i, light.specular.to_array());
    }

    /// Makes room for `n` points and the lanes behind the last.
    pub(crate) fn reserve(&mut self, n: usize) {
        [&mut self.ambient, &mut self.diffuse, &mut self.specular].into_iter().flatten().for_each(|c| make_room(c, n));
    }
}

/// Points in columns.
#[derive(Debug, Default)]
pub(crate) struct Points {
    /// Positions.
    pub(crate) p: Columns,
    /// Unit normals on the viewer's side.
    pub(crate) n: Columns,
    /// Unit, to the viewer.
    pub(crate) wo: Columns,
}

/// [`Coefficients`] in columns.
#[derive(Debug, Default)]
struct Reflection {
    sharpness: Vec<f32>,
    coat: Vec<f32>,
    f0: Vec<f32>,
    by: [Columns; 3],
}

/// Points waiting for light, and what comes of it.
#[derive(Debug)]
pub struct Unshadowed<'a> {
    world: &'a World,
    lights: &'a Lights,
    n_points: usize,
    points: Points,
    reflection: Reflection,
    /// The models of neighbouring points, each with the number of the first point behind them.
    runs: Vec<(Model, usize)>,
    n_lit: usize,
    light: LightColumns,
}

impl<'a> Unshadowed<'a> {
    /// Nothing waits.
    pub fn new(world: &'a World, lights: &'a Lights) -> Self {
        let (points, reflection, light) = Default::default();
        Self { world, lights, n_points: 0, points, reflection, runs: Vec::new(), n_lit: 0, light }
    }

    /// Forgets all points.
    pub fn clear(&mut self) {
        (self.n_points, self.n_lit) = (0, 0);
        self.runs.clear();
    }

    /// How many points were added: the number of the next one.
    pub fn n_points(&self) -> usize {
        self.n_points
    }

    /// Adds a point; its number is how many were added before.
    pub fn push(&mut self, surface: &Surface, shading: &Shading) {
        let i = self.n_points;
        self.reserve(1);
        let coefficients = Coefficients::of(&shading.bsdf);
        set3(&mut self.points.p, i, surface.p.to_array());
        set3(&mut self.points.n, i, shading.n.to_array());
        set3(&mut self.points.wo, i, shading.wo.to_array());
        let r = &mut self.reflection;
        (r.sharpness[i], r.coat[i], r.f0[i]) = (coefficients.sharpness, coefficients.coat, coefficients.f0);
        r.by.iter_mut().zip(coefficients.by).for_each(|(column, by)| set3(column, i, by.to_array()));
        let light = match &shading.bsdf {
            Bsdf::CookTorrance(_) => self.lights.at(self.world, surface, shading, false, &mut 0),
            _ => LocalLight { ambient: coefficients.ambient * self.lights.ambient(), ..LocalLight::default() },
        };
        self.light.set(i, &light);
        self.add(coefficients.model, 1);
    }

    /// Room for `n` points more, to be filled from [`Self::n_points`] on (up to seven behind the last may be overwritten), and then added by [`Self::push_tinted`].
    pub(crate) fn room(&mut self, n: usize) -> &mut Points {
        self.reserve(n);
        &mut self.points
    }

    /// Adds the `n` points that [`Self::room`] was filled with, of one reflection function under a tint each: `tint[i]` is that of point i of all.
    pub(crate) fn push_tinted(&mut self, n: usize, bsdf: &Tinted, tint: Option<&Columns>) {
        let range = self.n_points..self.n_points + n;
        let Tinted { black, white } = bsdf;
        let r = &mut self.reflection;
        r.sharpness[range.clone()].fill(white.sharpness);
        r.coat[range.clone()].fill(white.coat);
        r.f0[range.clone()].fill(white.f0);
        let lights = self.lights.ambient();
        let products = r.by.iter_mut().zip(black.by.into_iter().zip(white.by));
        let ambient = (&mut self.light.ambient, (black.ambient * lights, white.ambient * lights));
        for (columns, (black, white)) in products.chain([ambient]) {
            for (k, (column, (black, white))) in
                columns.iter_mut().zip(black.to_array().into_iter().zip(white.to_array())).enumerate()
            {
                let column = &mut column[range.clone()];
                match tint {
                    Some(tint) if black != white => {
                        column.iter_mut().zip(&tint[k][range.clone()]).for_each(|(c, t)| *c = black + t * (white - black));
                    }
                    _ => column.fill(white),
                }
            }
        }
        self.add(white.model, n);
    }

    fn add(&mut self, model: Model, n: usize) {
        self.n_points += n;
        match self.runs.last_mut() {
            Some(last) if last.0 == model => last.1 = self.n_points,
            _ => self.runs.push((model, self.n_points)),
        }
    }

    fn reserve(&mut self, n: usize) {
        let n = self.n_points + n;
        if self.reflection.f0.len() >= n + LANES {
            return;
        }
        let (p, r) = (&mut self.points, &mut self.reflection);
        [&mut p.p, &mut p.n, &mut p.wo].into_iter().chain(&mut r.by).flatten().for_each(|c| make_room(c, n));
        [&mut r.sharpness, &mut r.coat, &mut r.f0].into_iter().for_each(|c| make_room(c, n));
        self.light.reserve(n);
    }

    /// Lights what still waits; the light of every point by its number.
    pub fn finish(&mut self) -> &LightColumns {
        let path = self.world.cpu_path();
        let mut first = 0;
        for &(model, end) in &self.runs {
            let from = first.max(self.n_lit);
            if model != Model::Done && from < end {
                light(path, &self.points, &self.reflection, [from, end], model, self.lights.emitters(), &mut self.light);
            }
            first = end;
        }
        self.n_lit = self.n_points;
        &self.light
    }
}

fn set3(columns: &mut Columns, i: usize, v: [f32; 3]) {
    columns.iter_mut().zip(v).for_each(|(column, v)| column[i] = v);
}

/// Twice what is needed, so that points that come one by one do not each make room.
fn make_room(column: &mut Vec<f32>, n: usize) {
    if column.len() < n + LANES {
        column.resize(2 * n + LANES, 0.0);
    }
}

for_each_cpu! {
    fn light(
        points: &Points,
        reflection: &Reflection,
        range: [usize; 2],
        model: Model,
        emitters: &[Emitter],
        out: &mut LightColumns,
    ) = light_on;
}

/// Eight points under one light after the other.
struct Eight<L> {
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
fn light_on<C: Cpu>(
    points: &Points,
    reflection: &Reflection,
    [mut first, end]: [usize; 2],
    model: Model,
    emitters: &[Emitter],
    out: &mut LightColumns,
) {
    let zero = C::Wide::splat(0.0);
    while first < end {
        let (n, wo) = (load3(&points.n, first), load3(&points.wo, first));
        let mut eight_points = Eight::<C::Wide> {
            model,
            p: load3(&points.p, first),
            n,
            wo,
            n_v: dot(n, wo),
            sharpness: C::Wide::load(eight(&reflection.sharpness, first)),
            coat: C::Wide::load(eight(&reflection.coat, first)),
            f0: C::Wide::load(eight(&reflection.f0, first)),
            diffuse: [zero; 3],
            specular: [[zero; 3]; 2],
        };
        for emitter in emitters {
            eight_points.light(emitter);
        }
        let by: [V3<C::Wide>; 3] = xyz!(k => load3(&reflection.by[k], first));
        let [a, b] = eight_points.specular;
        let here = (end - first).min(LANES);
        let mut k = 0;
        while k < 3 {
            let diffuse = by[0][k].mul(eight_points.diffuse[k]).store();
            let specular = by[1][k].mul(a[k]).add(by[2][k].mul(b[k])).store();
            out.diffuse[k][first..first + here].copy_from_slice(&diffuse[..here]);
            out.specular[k][first..first + here].copy_from_slice(&specular[..here]);
            k += 1;
        }
        first += LANES;
    }
}

impl<L: Lanes> Eight<L> {
    #[inline(always)]
    fn light(&mut self, emitter: &Emitter) {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        match emitter {
            Emitter::Ambient(_) => {}
            Emitter::Hemispherical(l) => {
                let e = hemispherical(l, self.n);
                self.add_everywhere(e);
            }
            Emitter::Environment(_) => {
                // Looked up in a table, lane by lane.
                let n = [self.n[0].store(), self.n[1].store(), self.n[2].store()];
                let mut e = [[0.0; 8]; 3];
                let mut i = 0;
                while i < 8 {
                    [e[0][i], e[1][i], e[2][i]] = emitter.irradiance(Vec3::new(n[0][i], n[1][i], n[2][i])).to_array();
                    i += 1;
                }
                self.add_everywhere(xyz!(k => L::load(&e[k])));
            }
            Emitter::Point(l) => {
                let (wi, d, there) = self.towards(l.position);
                self.add(wi, falloff(l.falloff, d), there, l.diffuse, l.specular);
            }
            Emitter::Spot(l) => {
                let (wi, d, there) = self.towards(l.point.position);
                let f = falloff(l.point.falloff, d).mul(profile(l.profile, splat3(l.axis), wi));
                self.add(wi, f, there, l.point.diffuse, l.point.specular);
            }
            Emitter::Distant(l) => self.add(splat3(l.to_light), one, zero.le(one), l.diffuse, l.specular),
            Emitter::Discrete(l) => {
                for i in &l.incidents {
                    self.add(splat3(i.wi), one, zero.le(one), i.diffuse, i.specular);
                }
            }
            Emitter::Area(l) => {
                for s in &l.samples {
                    let (wi, d, there) = self.towards(s.position);
                    let cos = dot(splat3(s.normal), wi).neg();
                    let cos = if s.two_sided { cos.abs() } else { cos };
                    let f = L::splat(s.area).mul(cos).div(d).div(d);
                    self.add(wi, f, there, s.radiance, s.radiance);
                }
            }
        }
    }

    /// Adds irradiance from everywhere at once: the diffuse lobe as seen head-on.
    #[inline(always)]
    fn add_everywhere(&mut self, irradiance: V3<L>) {
        let share = L::splat(1.0).sub(self.coat.mul(self.f0)).mul(L::splat(FRAC_1_PI));
        self.diffuse = xyz!(k => self.diffuse[k].add(irradiance[k].mul(share)));
    }

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
            Model::Done | Model::Lambert => s = zero,
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
        self.diffuse = xyz!(k => self.diffuse[k].add(d.mul(L::splat(e_d[k]))));
        if self.model != Model::Lambert {
            self.specular[0] = xyz!(k => self.specular[0][k].add(s.mul(L::splat(e_s[k]))));
        }
        if self.model == Model::MetallicRoughness {
            self.specular[1] = xyz!(k => self.specular[1][k].add(grazing.mul(L::splat(e_s[k]))));
        }
    }
}

/// As [`Hemispherical::irradiance`].
#[inline(always)]
fn hemispherical<L: Lanes>(l: &Hemispherical, n: V3<L>) -> V3<L> {
    let one = L::splat(1.0);
    let t = L::splat(0.5).mul(one.add(dot(n, splat3(l.axis)).max(one.neg()).min(one)));
    let (up, down) = (l.up.to_array(), l.down.to_array());
    xyz!(k => L::splat(up[k]).mul(t).add(L::splat(down[k]).mul(one.sub(t))).mul(L::splat(PI)))
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
