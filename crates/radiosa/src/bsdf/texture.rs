//! Looking up textures.
//!
//! Texture coordinates have (0, 0) at the upper left corner of the picture and (1, 1) at the lower right one, as in glTF; the
//! centre of texel (i, j) of a picture of w × h lies at ((i + 1/2)/w, (j + 1/2)/h). Colours are decoded before they are interpolated, so
//! what lies between two texels is a mixture of light. What is too fine for the pixels is averaged by taking
//! more samples of them, or read from ever smaller copies ([`Pyramid`], [Williams83]) where the texture's filter says so.

use crate::film::srgb;
use crate::math::lanes::{Columns, Cpu, Ints, LANES, Lanes, eight, eight_mut, for_each_cpu, xyz};
use crate::math::{CpuPath, Vec2};
use crate::scene::{Filter, Image, Pixels, Sampler, Scene, Texture, TextureRef, TextureSource, Wrap};

/// A texture's red, green, blue and alpha at `uv`, the coordinates of the reference's set before its transform. Linear, whatever
/// the encoding in the file; 8 and 16 bits come out between 0 and 1. Coordinates that are not finite count as 0.
pub fn sample(scene: &Scene, reference: &TextureRef, uv: Vec2) -> [f32; 4] {
    let uv = reference.transform.map_or(uv, |transform| transform.apply(uv));
    let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
    let texture = &scene.textures[reference.texture.index()];
    sample_texture(scene, texture, Vec2::new(finite(uv.x), finite(uv.y)))
}

fn sample_texture(scene: &Scene, texture: &Texture, uv: Vec2) -> [f32; 4] {
    match &texture.source {
        TextureSource::Image(id) => sample_image(&scene.images[id.index()], texture.sampler, texture.is_srgb, uv),
        TextureSource::Checker { even, odd, scale } => {
            // Half a whole number and what is left of it are exact in f32, however large it is.
            let half = (uv * *scale).floor() * 0.5;
            let is_odd = (half - half.floor()).element_sum() == 0.5;
            let [r, g, b] = if is_odd { odd.to_array() } else { even.to_array() };
            [r, g, b, 1.0]
        }
    }
}

/// A picture's red, green, blue and alpha at `uv`, which must be finite.
pub fn sample_image(image: &Image, sampler: Sampler, is_srgb: bool, uv: Vec2) -> [f32; 4] {
    let (x, y) = (place(uv.x, image.width, sampler.wrap_u), place(uv.y, image.height, sampler.wrap_v));
    let column = |i: i64| wrap_index(i, i64::from(image.width), sampler.wrap_u);
    let row = |j: i64| wrap_index(j, i64::from(image.height), sampler.wrap_v) * image.width as usize;
    let read = |texel: &dyn Fn(usize) -> [f32; 4]| texel(row(floor(y)) + column(floor(x)));
    let nearest = sampler.filter == Filter::Nearest;
    let (i, j) = (floor(x - 0.5), floor(y - 0.5));
    let (s, t) = ((x - 0.5 - i as f64) as f32, (y - 0.5 - j as f64) as f32);
    // The kind of picture is decided once for all four texels.
    match &image.pixels {
        Pixels::Rgba8(values) => {
            let table = if is_srgb { srgb::byte_table() } else { linear_table() };
            let texel = |i: usize| rgba8(values, table, i);
            if nearest { read(&texel) } else { bilinear([column(i), column(i + 1)], [row(j), row(j + 1)], s, t, texel) }
        }
        _ => {
            let texel = |i: usize| texel(image, is_srgb, i);
            if nearest { read(&texel) } else { bilinear([column(i), column(i + 1)], [row(j), row(j + 1)], s, t, texel) }
        }
    }
}

/// The mean of the four texels around a point, weighed by how near they are.
#[inline(always)]
fn bilinear(columns: [usize; 2], rows: [usize; 2], s: f32, t: f32, texel: impl Fn(usize) -> [f32; 4]) -> [f32; 4] {
    let [i, k] = columns;
    let [j, l] = rows;
    let (a, b, c, d) = (texel(j + i), texel(j + k), texel(l + i), texel(l + k));
    std::array::from_fn(|k| {
        let (top, bottom) = (a[k] + s * (b[k] - a[k]), c[k] + s * (d[k] - c[k]));
        top + t * (bottom - top)
    })
}

/// What most textures are, a picture of bytes read by its four nearest texels, for eight points at a time: [`sample`] in lanes. Places are kept in f32
/// here: a texel is off by 2⁻²⁴ of the picture's side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bilinear<'a> {
    texels: &'a [[u8; 4]],
    decode: &'static [f32; 256],
    size: [u32; 2],
    wrap: [Wrap; 2],
}

impl<'a> Bilinear<'a> {
    /// `None` where the texture is something else.
    pub(crate) fn new(scene: &'a Scene, texture: &Texture) -> Option<Self> {
        let TextureSource::Image(id) = &texture.source else { return None };
        Self::of_image(&scene.images[id.index()], texture)
    }

    /// The same of one of the texture's copies.
    fn of_image(image: &'a Image, texture: &Texture) -> Option<Self> {
        let sampler = texture.sampler;
        let Pixels::Rgba8(values) = &image.pixels else { return None };
        if sampler.filter == Filter::Nearest {
            return None;
        }
        let decode = if texture.is_srgb { srgb::byte_table() } else { linear_table() };
        let (size, wrap) = ([image.width, image.height], [sampler.wrap_u, sampler.wrap_v]);
        Some(Self { texels: values.as_chunks().0, decode, size, wrap })
    }

    /// The colours at points `range` of a triangle, given by their barycentric weights; `uv` are the coordinates at its vertices, after the reference's transform.
    pub(crate) fn sample(&self, path: CpuPath, uv: &[Vec2; 3], weights: &Columns, range: [usize; 2], out: &mut Columns) {
        sample_eight(path, self, uv, weights, range, out);
    }
}

impl Bilinear<'_> {
    /// The same from the texture's copies, mixed as [`sample_level`] does: copy `c` has the share `(1 − |level − c|)⁺`. `level` is that of each point, `copy` is
    /// overwritten.
    pub(crate) fn sample_levels(
        &self,
        path: CpuPath,
        (texture, pyramid): (&Texture, &Pyramid),
        (uv, weights): (&[Vec2; 3], &Columns),
        (level, range): (&[f32], [usize; 2]),
        (copy, out): (&mut Columns, &mut Columns),
    ) {
        let points = range[0]..range[1];
        let last = pyramid.copies.len() as f32;
        let levels = || level[points.clone()].iter().map(|l| l.clamp(0.0, last));
        let (least, greatest) = levels().fold((last, 0.0f32), |(lo, hi), l| (lo.min(l), hi.max(l)));
        out.iter_mut().for_each(|column| column[points.clone()].fill(0.0));
        for c in least as usize..=greatest.ceil() as usize {
            let picture = if c == 0 { Some(*self) } else { Bilinear::of_image(&pyramid.copies[c - 1], texture) };
            let Some(picture) = picture else { return };
            picture.sample(path, uv, weights, range, copy);
            for (out, copy) in out.iter_mut().zip(&*copy) {
                for ((out, copy), level) in out[points.clone()].iter_mut().zip(&copy[points.clone()]).zip(levels()) {
                    *out += (1.0 - (level - c as f32).abs()).max(0.0) * copy;
                }
            }
        }
    }
}

for_each_cpu! {
    fn sample_eight(picture: &Bilinear<'_>, uv: &[Vec2; 3], weights: &Columns, range: [usize; 2], out: &mut Columns) = sample_eight_on;
}

#[inline(always)]
fn sample_eight_on<C: Cpu>(
    picture: &Bilinear<'_>,
    uv: &[Vec2; 3],
    weights: &Columns,
    [mut first, end]: [usize; 2],
    out: &mut Columns,
) {
    type L<C> = <C as Cpu>::Wide;
    while first < end {
        let w = xyz!(k => L::<C>::load(eight(&weights[k], first)));
        let (columns, s) = neighbours(mix([uv[0].x, uv[1].x, uv[2].x], w), picture.size[0], picture.wrap[0]);
        let (rows, t) = neighbours(mix([uv[0].y, uv[1].y, uv[2].y], w), picture.size[1], picture.wrap[1]);
        let mut read = [[[0.0; LANES]; 3]; 4];
        let width = picture.size[0] as usize;
        let mut lane = 0;
        while lane < LANES {
            let [left, right] = [columns[0][lane] as usize, columns[1][lane] as usize];
            let [top, bottom] = [rows[0][lane] as usize * width, rows[1][lane] as usize * width];
            let corners = [top + left, top + right, bottom + left, bottom + right];
            let mut corner = 0;
            while corner < 4 {
                let [r, g, b, _] = picture.texels[corners[corner]];
                read[corner][0][lane] = picture.decode[usize::from(r)];
                read[corner][1][lane] = picture.decode[usize::from(g)];
                read[corner][2][lane] = picture.decode[usize::from(b)];
                corner += 1;
            }
            lane += 1;
        }
        let mut k = 0;
        while k < 3 {
            let (a, b) = (L::<C>::load(&read[0][k]), L::<C>::load(&read[1][k]));
            let (c, d) = (L::<C>::load(&read[2][k]), L::<C>::load(&read[3][k]));
            let (upper, lower) = (a.add(s.mul(b.sub(a))), c.add(s.mul(d.sub(c))));
            *eight_mut(&mut out[k], first) = upper.add(t.mul(lower.sub(upper))).store();
            k += 1;
        }
        first += LANES;
    }
}

/// `Σ v w`.
#[inline(always)]
fn mix<L: Lanes>(v: [f32; 3], w: [L; 3]) -> L {
    L::splat(v[0]).mul(w[0]).add(L::splat(v[1]).mul(w[1])).add(L::splat(v[2]).mul(w[2]))
}

/// The texels on either side of coordinates along one axis of `n` texels, and how far from the first to the second.
#[inline(always)]
fn neighbours<L: Lanes>(u: L, n: u32, wrap: Wrap) -> ([[i32; 8]; 2], L) {
    let (zero, one, half) = (L::splat(0.0), L::splat(1.0), L::splat(0.5));
    let n = L::splat(n as f32);
    let u = L::select(u.abs().le(L::splat(f32::MAX)), u, zero);
    let near = match wrap {
        Wrap::Repeat => u.sub(whole(u)),
        Wrap::Mirror => u.sub(L::splat(2.0).mul(whole(half.mul(u)))),
        Wrap::Clamp => u.max(one.neg()).min(L::splat(2.0)),
    };
    let x = near.mul(n).sub(half);
    let i = whole(x);
    ([within(i, n, wrap).round().store(), within(i.add(one), n, wrap).round().store()], x.sub(i))
}

/// The texel that stands at `i`, of `n`: [`wrap_index`] for what lies a texel outside of the picture at most, or of its mirror image behind it.
#[inline(always)]
fn within<L: Lanes>(i: L, n: L, wrap: Wrap) -> L {
    let (zero, last) = (L::splat(0.0), n.sub(L::splat(1.0)));
    match wrap {
        Wrap::Repeat => L::select(i.lt(zero), last, L::select(last.lt(i), zero, i)),
        Wrap::Mirror => L::select(last.lt(i), last.add(n).sub(i), i).max(zero),
        Wrap::Clamp => i.max(zero).min(last),
    }
}

/// The largest whole number not above `x`.
#[inline(always)]
fn whole<L: Lanes>(x: L) -> L {
    // Beyond 2²³ f32 knows whole numbers only.
    let near = x.abs().lt(L::splat(8_388_608.0));
    let rounded = L::of_ints(x.round());
    L::select(near, rounded.sub(L::select(x.lt(rounded), L::splat(1.0), L::splat(0.0))), x)
}

/// A picture's smaller copies: each half as wide and high as the one before, down to one texel.
#[derive(Clone, Debug)]
pub struct Pyramid {
    copies: Vec<Image>,
}

impl Pyramid {
    /// The copies a texture wants; `None` where its filter wants none or it is no picture.
    pub fn of_texture(texture: &Texture, images: &[Image]) -> Option<Self> {
        match texture.source {
            TextureSource::Image(id) if texture.sampler.filter == Filter::Mipmap => {
                Some(Self::new(&images[id.index()], texture.is_srgb))
            }
            _ => None,
        }
    }

    /// All copies of a picture. Colours are averaged as light and stored as the picture stores them.
    pub fn new(image: &Image, is_srgb: bool) -> Self {
        let mut copies: Vec<Image> = Vec::new();
        loop {
            let last = copies.last().unwrap_or(image);
            if last.width <= 1 && last.height <= 1 {
                return Self { copies };
            }
            let half = halved(last, is_srgb);
            copies.push(half);
        }
    }
}

/// A copy half as wide and high; the last column or row of an odd side is in the mean of its neighbour.
fn halved(image: &Image, is_srgb: bool) -> Image {
    let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
    // The texels of the larger picture under one of the smaller: two, or three where its side is odd and this is the last.
    let span = |i: u32, n: u32, half: u32| (2 * i).min(n - 1)..if i + 1 == half { n } else { 2 * i + 2 };
    let mut values = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut n) = ([0.0; 4], 0.0);
            for j in span(y, image.height, height) {
                for i in span(x, image.width, width) {
                    let texel = texel(image, is_srgb, j as usize * image.width as usize + i as usize);
                    sum.iter_mut().zip(texel).for_each(|(s, t)| *s += t);
                    n += 1.0;
                }
            }
            let encode = |k: usize, v: f32| if is_srgb && k < 3 { srgb::encode(v) } else { v };
            values.extend(sum.iter().enumerate().map(|(k, s)| match image.pixels {
                Pixels::Rgba32F(_) => s / n,
                _ => encode(k, s / n),
            }));
        }
    }
    let pixels = match image.pixels {
        Pixels::Rgba8(_) => Pixels::Rgba8(values.iter().map(|v| (v * 255.0).round() as u8).collect()),
        Pixels::Rgba16(_) => Pixels::Rgba16(values.iter().map(|v| (v * 65_535.0).round() as u16).collect()),
        Pixels::Rgba32F(_) => Pixels::Rgba32F(values.into()),
    };
    Image { name: image.name.clone(), width, height, pixels }
}

/// A texture's red, green, blue and alpha at `uv` from its smaller copies: `level` 0 is the picture, 1 half its size, in between a mixture.
pub fn sample_level(scene: &Scene, reference: &TextureRef, pyramid: &Pyramid, uv: Vec2, level: f32) -> [f32; 4] {
    let texture = &scene.textures[reference.texture.index()];
    let (TextureSource::Image(id), true) = (&texture.source, level > 0.0) else { return sample(scene, reference, uv) };
    let uv = reference.transform.map_or(uv, |transform| transform.apply(uv));
    if !uv.is_finite() {
        return sample(scene, reference, uv);
    }
    let level = level.min(pyramid.copies.len() as f32);
    let (below, between) = (level as usize, level.fract());
    let copy = |i: usize| if i == 0 { &scene.images[id.index()] } else { &pyramid.copies[i - 1] };
    let read = |i: usize| sample_image(copy(i), texture.sampler, texture.is_srgb, uv);
    let fine = read(below);
    if between == 0.0 {
        return fine;
    }
    let coarse = read(below + 1);
    std::array::from_fn(|k| fine[k] + between * (coarse[k] - fine[k]))
}

/// The largest whole number not above `x`, which is within ±2⁶²: the baseline processor has no instruction for it, and calling for it here is slow.
fn floor(x: f64) -> i64 {
    let i = x as i64;
    i - i64::from(i as f64 > x)
}

/// A coordinate in texels, brought near enough to the picture that whole numbers of them stay small.
fn place(u: f32, n: u32, wrap: Wrap) -> f64 {
    let u = f64::from(u);
    // Beyond this f32 knows whole turns only.
    let whole = |u: f64| if u.abs() < 1e15 { floor(u) as f64 } else { u };
    let near = match wrap {
        Wrap::Repeat => u - whole(u),
        Wrap::Mirror => u - 2.0 * whole(u * 0.5),
        Wrap::Clamp => u.clamp(-1.0, 2.0),
    };
    near * f64::from(n)
}

/// The texel that stands at `i`, for pictures of `n` texels.
fn wrap_index(i: i64, n: i64, wrap: Wrap) -> usize {
    if (0..n).contains(&i) {
        return i as usize;
    }
    let i = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * n);
            if i < n { i } else { 2 * n - 1 - i }
        }
        Wrap::Clamp => i.clamp(0, n - 1),
    };
    i as usize
}

/// Texel `i` of bytes, its colour decoded by a table.
#[inline(always)]
fn rgba8(values: &[u8], table: &[f32; 256], i: usize) -> [f32; 4] {
    let p = &values[4 * i..4 * i + 4];
    [table[usize::from(p[0])], table[usize::from(p[1])], table[usize::from(p[2])], linear_table()[usize::from(p[3])]]
}

/// Bytes as numbers between 0 and 1.
fn linear_table() -> &'static [f32; 256] {
    static TABLE: [f32; 256] = {
        let mut table = [0.0; 256];
        let mut i = 0;
        while i < 256 {
            table[i] = i as f32 / 255.0;
            i += 1;
        }
        table
    };
    &TABLE
}

fn texel(image: &Image, is_srgb: bool, i: usize) -> [f32; 4] {
    match &image.pixels {
        Pixels::Rgba8(values) => rgba8(values, if is_srgb { srgb::byte_table() } else { linear_table() }, i),
        Pixels::Rgba16(values) => {
            let p: [f32; 4] = std::array::from_fn(|k| f32::from(values[4 * i + k]) / 65_535.0);
            if is_srgb { [srgb::decode(p[0]), srgb::decode(p[1]), srgb::decode(p[2]), p[3]] } else { p }
        }
        Pixels::Rgba32F(values) => std::array::from_fn(|k| values[4 * i + k]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec2;
    use crate::scene::{ImageId, TextureId, UvTransform};
    use crate::spectrum::Spectrum;

    /// Two by one texels: red 0 and 1 (of one), alpha 1 and 0.
    fn two_texels() -> Image {
        let pixels = Pixels::Rgba8([0, 188, 255, 255, 255, 188, 0, 0][..].into());
        Image { name: String::new(), width: 2, height: 1, pixels }
    }

    fn sampler(wrap: Wrap, filter: Filter) -> Sampler {
        Sampler { wrap_u: wrap, wrap_v: wrap, filter }
    }

    fn red(wrap: Wrap, filter: Filter, u: f32) -> f32 {
        sample_image(&two_texels(), sampler(wrap, filter), false, Vec2::new(u, 0.5))[0]
    }

    #[test]
    fn texel_centres_lie_at_half_integers() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Nearest, Filter::Bilinear] {
                assert_eq!(red(wrap, filter, 0.25), 0.0);
                assert_eq!(red(wrap, filter, 0.75), 1.0);
            }
            assert_eq!(red(wrap, Filter::Bilinear, 0.5), 0.5);
            assert_eq!(red(wrap, Filter::Bilinear, 0.375), 0.25);
        }
    }

    #[test]
    fn each_wrap_continues_in_its_own_way() {
        let all = |wrap| [-0.75, -0.25, 1.25, 1.75, 2.25].map(|u| red(wrap, Filter::Nearest, u));
        assert_eq!(all(Wrap::Repeat), [0.0, 1.0, 0.0, 1.0, 0.0]);
        assert_eq!(all(Wrap::Mirror), [1.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(all(Wrap::Clamp), [0.0, 0.0, 1.0, 1.0, 1.0]);
        // At the seam, repeating mixes both ends and the others do not.
        assert_eq!([Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].map(|w| red(w, Filter::Bilinear, 0.0)), [0.5, 0.0, 0.0]);
    }

    #[test]
    fn colours_are_decoded_before_they_are_mixed_and_alpha_never() {
        let smooth = sampler(Wrap::Clamp, Filter::Bilinear);
        let [r, g, b, a] = sample_image(&two_texels(), smooth, true, Vec2::new(0.5, 0.5));
        assert_eq!((r, b, a), (0.5, 0.5, 0.5));
        assert!((g - srgb::decode(188.0 / 255.0)).abs() < 1e-6 && (g - 0.5029).abs() < 1e-4);
        let sixteen = Image { pixels: Pixels::Rgba16([32_768; 8][..].into()), ..two_texels() };
        let [r, .., a] = sample_image(&sixteen, smooth, true, Vec2::ZERO);
        assert!((r - 0.214_05).abs() < 1e-4 && (a - 0.5).abs() < 1e-4);
    }

    #[test]
    fn smaller_copies_keep_the_mean_light_and_a_level_between_is_a_mixture() {
        // 5 × 3 texels, black and white in checks, sRGB: copies of 2 × 1 and 1 × 1.
        let bytes: Vec<u8> = (0..15u8).flat_map(|i| [255 * (i % 2), 255 * (i % 2), 0, 255]).collect();
        let image = Image { name: String::new(), width: 5, height: 3, pixels: Pixels::Rgba8(bytes.into()) };
        let pyramid = Pyramid::new(&image, true);
        let sizes: Vec<_> = pyramid.copies.iter().map(|c| (c.width, c.height)).collect();
        assert_eq!(sizes, [(2, 1), (1, 1)]);
        // 3 of 6 and 4 of 9 texels are white: the mean of light, not of bytes.
        assert!((texel(&pyramid.copies[0], true, 0)[0] - 0.5).abs() < 4e-3);
        assert!((texel(&pyramid.copies[0], true, 1)[0] - 4.0 / 9.0).abs() < 4e-3);
        let sampler = Sampler { filter: Filter::Mipmap, ..Sampler::default() };
        let texture = Texture { source: TextureSource::Image(ImageId(0)), sampler, is_srgb: true };
        let scene = Scene { textures: vec![texture], images: vec![image], ..Scene::default() };
        let at = |level: f32| sample_level(&scene, &TextureRef::new(TextureId(0)), &pyramid, Vec2::new(0.5, 0.5), level)[0];
        let whole = at(2.0);
        assert!((whole - 17.0 / 36.0).abs() < 6e-3 && at(50.0) == whole, "{whole}");
        assert!((at(1.5) - 0.5 * (at(1.0) + at(2.0))).abs() < 1e-6);
        assert_eq!(at(-3.0), sample(&scene, &TextureRef::new(TextureId(0)), Vec2::new(0.5, 0.5))[0]);
    }

    #[test]
    fn eight_points_at_a_time_are_read_as_one_is() {
        let bytes: Vec<u8> = (0..4 * 7 * 5u32).map(|i| (i * 37 % 256) as u8).collect();
        let image = Image { name: String::new(), width: 7, height: 5, pixels: Pixels::Rgba8(bytes.into()) };
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for is_srgb in [false, true] {
                let texture =
                    Texture { source: TextureSource::Image(ImageId(0)), sampler: sampler(wrap, Filter::Bilinear), is_srgb };
                let scene = Scene { textures: vec![texture.clone()], images: vec![image.clone()], ..Scene::default() };
                let picture = Bilinear::new(&scene, &texture).expect("it is such a picture");
                for reach in [0.3, 3.0, 1e30, f32::INFINITY] {
                    let uv = [Vec2::new(-reach, 0.25), Vec2::new(reach, -0.7), Vec2::new(0.1, 0.9 * reach)];
                    let n = 41;
                    let weights: Columns =
                        [0, 1, 2].map(|k| (0..n + LANES).map(|i| ((i * (k + 2)) % 11) as f32 / 16.0).collect());
                    let mut all: [Columns; 2] = [(); 2].map(|()| [(); 3].map(|()| vec![0.0; n + LANES]));
                    for (path, out) in [CpuPath::Portable, CpuPath::detect()].into_iter().zip(&mut all) {
                        picture.sample(path, &uv, &weights, [0, n], out);
                    }
                    for i in 0..n {
                        let at = (0..3).map(|k| uv[k] * weights[k][i]).fold(Vec2::ZERO, |sum, v| sum + v);
                        let one = super::sample(&scene, &TextureRef::new(TextureId(0)), at);
                        for k in 0..3 {
                            assert_eq!(all[0][k][i].to_bits(), all[1][k][i].to_bits());
                            assert!((all[0][k][i] - one[k]).abs() < 1e-4, "{wrap:?} {at}: {} {}", all[0][k][i], one[k]);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn no_coordinate_is_too_odd() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Nearest, Filter::Bilinear] {
                for u in [0.0, -0.0, 1.0, -1e-30, 1e30, -1e30, f32::MAX, f32::MIN, 16_777_217.0] {
                    assert!((0.0..=1.0).contains(&red(wrap, filter, u)), "{wrap:?} {filter:?} {u}");
                }
            }
        }
    }

    #[test]
    fn references_transform_and_checkers_alternate() {
        let source = TextureSource::Checker { even: Spectrum::WHITE, odd: Spectrum::BLACK, scale: Vec2::new(2.0, 2.0) };
        let checker = Texture { source, sampler: Sampler::default(), is_srgb: false };
        let image = Texture { source: TextureSource::Image(ImageId(0)), ..checker.clone() };
        let scene = Scene { textures: vec![checker, image], images: vec![two_texels()], ..Scene::default() };
        let reference = TextureRef::new(TextureId(0));
        let at = |r: &TextureRef, u, v| sample(&scene, r, Vec2::new(u, v))[0];
        assert_eq!([at(&reference, 0.1, 0.1), at(&reference, 0.6, 0.1), at(&reference, 0.6, 0.6)], [1.0, 0.0, 1.0]);
        assert_eq!([at(&reference, -0.1, 0.1), at(&reference, -0.6, 0.1)], [0.0, 1.0]);
        let moved = TextureRef { transform: Some(UvTransform::new(DVec2::new(0.5, 0.0), 0.0, DVec2::ONE)), ..reference };
        assert_eq!(at(&moved, 0.1, 0.1), 0.0);
        for (u, v) in [(f32::NAN, 0.0), (f32::INFINITY, f32::NEG_INFINITY), (f32::MAX, f32::MAX), (-1e38, 3.0)] {
            for texture in [0, 1] {
                let r = TextureRef { transform: moved.transform, ..TextureRef::new(TextureId(texture)) };
                assert!((0.0..=1.0).contains(&at(&r, u, v)));
            }
        }
    }
}
