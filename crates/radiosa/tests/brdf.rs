//! Every directional entry of the table of reflection values (`brdf.json`), computed twice: by independent formulas in f64, to
//! 1e-9, and by what ships, in f32, to 1e-4. Both go through one checking function, and wrong formulas must not pass it.
#![expect(clippy::print_stderr, reason = "tests say what they measured")]

use std::cell::RefCell;
use std::f64::consts::PI;

use radiosa::bsdf::{Bsdf, cook_torrance, dielectric, fresnel, microfacet, mirror, phong};
use radiosa::emitter::environment::{Map, Sky};
use radiosa::emitter::{Emitter, EnvironmentShadows};
use radiosa::math::{DVec3, Vec3};
use radiosa::scene::{self, Attenuation, Cone, Form, Light, LightKind, PhongLobe, PhotometricUnit};
use radiosa::spectrum::Spectrum;
use radiosa_testkit::brdf::{self as exact, Distribution, Shadowing, V};
use serde_json::Value;

const N: V = [0.0, 0.0, 1.0];

/// Reflectance of a facet.
#[derive(Clone, Copy)]
enum Facet {
    One,
    Dielectric(f64),
    Conductor(f64, f64),
    Schlick(f64),
}

/// One set of formulas under test.
trait Formulas {
    fn phong(&self, l: V, v: V, e: f64) -> f64;
    fn blinn(&self, l: V, v: V, e: f64) -> f64;
    fn lafortune(&self, l: V, v: V, e: f64) -> f64;
    fn d(&self, d: Distribution, alpha: f64, h: V) -> f64;
    fn g(&self, d: Distribution, g: Shadowing, alpha: f64, l: V, v: V) -> f64;
    fn g1(&self, d: Distribution, alpha: f64, cos: f64) -> f64;
    fn g1_fit(&self, alpha: f64, cos: f64) -> f64;
    #[expect(clippy::too_many_arguments, reason = "the paper's symbols, each once")]
    fn cook_torrance(&self, d: Distribution, g: Shadowing, alpha: f64, f: Facet, form: Form, l: V, v: V) -> f64;
    fn dielectric(&self, cos: f64, n1: f64, n2: f64) -> f64;
    fn conductor(&self, cos: f64, n: f64, k: f64) -> f64;
    fn schlick(&self, cos: f64, f0: f64) -> f64;
    fn reflect(&self, d: V) -> V;
    fn refract(&self, d: V, n1: f64, n2: f64) -> Option<V>;
    fn attenuation(&self, c: [f64; 3], d: f64) -> f64;
    fn spotlight(&self, k: f64, cutoff: f64, angle: f64) -> f64;
    fn hemisphere(&self, tilt: f64, up: f64, down: f64) -> f64;
}

/// The independent formulas.
struct Exact;

impl Formulas for Exact {
    fn phong(&self, l: V, v: V, e: f64) -> f64 {
        exact::phong(N, l, v, e)
    }
    fn blinn(&self, l: V, v: V, e: f64) -> f64 {
        exact::blinn(N, l, v, e)
    }
    fn lafortune(&self, l: V, v: V, e: f64) -> f64 {
        exact::lafortune(N, l, v, e)
    }
    fn d(&self, d: Distribution, alpha: f64, h: V) -> f64 {
        exact::d(d, alpha, h[2])
    }
    fn g(&self, d: Distribution, g: Shadowing, alpha: f64, l: V, v: V) -> f64 {
        exact::g(g, d, alpha, N, l, v)
    }
    fn g1(&self, d: Distribution, alpha: f64, cos: f64) -> f64 {
        exact::g1(d, alpha, cos)
    }
    fn g1_fit(&self, alpha: f64, cos: f64) -> f64 {
        exact::g1_beckmann_fit(alpha, cos)
    }
    fn cook_torrance(&self, d: Distribution, g: Shadowing, alpha: f64, f: Facet, form: Form, l: V, v: V) -> f64 {
        let cos = exact::dot(v, exact::half(l, v));
        let f = match f {
            Facet::One => 1.0,
            Facet::Dielectric(ior) => self.dielectric(cos, 1.0, ior),
            Facet::Conductor(n, k) => self.conductor(cos, n, k),
            Facet::Schlick(f0) => self.schlick(cos, f0),
        };
        match form {
            Form::Modern => exact::cook_torrance(d, g, alpha, f, N, l, v),
            Form::Paper1982 => exact::cook_torrance_1982(d, g, alpha, f, N, l, v),
            Form::Lecture => exact::cook_torrance_1982(d, g, alpha, f, N, l, v) * l[2],
        }
    }
    fn dielectric(&self, cos: f64, n1: f64, n2: f64) -> f64 {
        exact::fresnel_dielectric(cos, n1, n2)
    }
    fn conductor(&self, cos: f64, n: f64, k: f64) -> f64 {
        exact::fresnel_conductor(cos, n, k)
    }
    fn schlick(&self, cos: f64, f0: f64) -> f64 {
        exact::schlick(cos, f0)
    }
    fn reflect(&self, d: V) -> V {
        exact::reflect(d, N)
    }
    fn refract(&self, d: V, n1: f64, n2: f64) -> Option<V> {
        exact::refract(d, N, n1, n2)
    }
    fn attenuation(&self, c: [f64; 3], d: f64) -> f64 {
        exact::attenuation(c[0], c[1], c[2], d)
    }
    fn spotlight(&self, k: f64, cutoff: f64, angle: f64) -> f64 {
        exact::spotlight(k, cutoff, angle)
    }
    fn hemisphere(&self, tilt: f64, up: f64, down: f64) -> f64 {
        exact::hemisphere(tilt, up, down)
    }
}

/// What the engine uses.
struct Shipped;

fn vec3(v: V) -> Vec3 {
    DVec3::from_array(v).as_vec3()
}

fn array(v: Vec3) -> V {
    v.as_dvec3().to_array()
}

fn distribution(d: Distribution) -> scene::Distribution {
    match d {
        Distribution::Beckmann => scene::Distribution::Beckmann,
        Distribution::Ggx => scene::Distribution::Ggx,
    }
}

fn shadowing(g: Shadowing) -> scene::Shadowing {
    match g {
        Shadowing::VCavity => scene::Shadowing::VCavity,
        Shadowing::Smith => scene::Shadowing::Smith,
        Shadowing::SmithCorrelated => scene::Shadowing::SmithCorrelated,
    }
}

/// A highlight without a diffuse part.
fn highlight(lobe: PhongLobe, e: f64) -> Bsdf {
    Bsdf::Phong(phong::Phong { specular: Spectrum::WHITE, exponent: e as f32, lobe, ..phong::Phong::default() })
}

impl Formulas for Shipped {
    // The classic lobes as a classic light of intensity one shows them: π f cos.
    fn phong(&self, l: V, v: V, e: f64) -> f64 {
        PI * f64::from(highlight(PhongLobe::Phong, e).evaluate_cos(vec3(N), vec3(v), vec3(l)).specular.g)
    }
    fn blinn(&self, l: V, v: V, e: f64) -> f64 {
        PI * f64::from(highlight(PhongLobe::BlinnPhong, e).evaluate_cos(vec3(N), vec3(v), vec3(l)).specular.g)
    }
    fn lafortune(&self, l: V, v: V, e: f64) -> f64 {
        f64::from(phong::lafortune(Spectrum::WHITE, vec3(N), vec3(v), vec3(l), e as f32).g)
    }
    fn d(&self, d: Distribution, alpha: f64, h: V) -> f64 {
        // With light and viewer both at h, h is the halfway vector.
        let Some(angles) = microfacet::Angles::new(vec3(N), vec3(h), vec3(h)) else { return 0.0 };
        f64::from(microfacet::d(distribution(d), alpha as f32, &angles))
    }
    fn g(&self, d: Distribution, g: Shadowing, alpha: f64, l: V, v: V) -> f64 {
        let angles = microfacet::Angles::new(vec3(N), vec3(v), vec3(l)).expect("samples lie above the horizon");
        f64::from(microfacet::g(shadowing(g), distribution(d), alpha as f32, &angles))
    }
    fn g1(&self, d: Distribution, alpha: f64, cos: f64) -> f64 {
        f64::from(microfacet::g1(distribution(d), alpha as f32, cos as f32))
    }
    fn g1_fit(&self, alpha: f64, cos: f64) -> f64 {
        f64::from(microfacet::g1_beckmann_fit(alpha as f32, cos as f32))
    }
    fn cook_torrance(&self, d: Distribution, g: Shadowing, alpha: f64, f: Facet, form: Form, l: V, v: V) -> f64 {
        let gray = |x: f64| Spectrum::gray(x as f32);
        let bsdf = Bsdf::CookTorrance(cook_torrance::CookTorrance {
            ambient: Spectrum::BLACK,
            diffuse: Spectrum::BLACK,
            specular: Spectrum::WHITE,
            alpha: alpha as f32,
            distribution: distribution(d),
            shadowing: shadowing(g),
            fresnel: match f {
                Facet::One => scene::Fresnel::One,
                Facet::Dielectric(ior) => scene::Fresnel::Dielectric { ior: ior as f32 },
                Facet::Conductor(n, k) => scene::Fresnel::Conductor { n: gray(n), k: gray(k) },
                Facet::Schlick(f0) => scene::Fresnel::Schlick { f0: gray(f0) },
            },
            form,
            transmission: None,
            compensation: None,
        });
        f64::from(bsdf.evaluate(vec3(N), vec3(v), vec3(l)).specular.g)
    }
    fn dielectric(&self, cos: f64, n1: f64, n2: f64) -> f64 {
        f64::from(fresnel::dielectric(cos as f32, (n2 / n1) as f32))
    }
    fn conductor(&self, cos: f64, n: f64, k: f64) -> f64 {
        f64::from(fresnel::conductor(cos as f32, n as f32, k as f32))
    }
    fn schlick(&self, cos: f64, f0: f64) -> f64 {
        f64::from(fresnel::schlick(cos as f32, Spectrum::gray(f0 as f32)).g)
    }
    fn reflect(&self, d: V) -> V {
        array(mirror::reflect(-vec3(d), vec3(N)))
    }
    fn refract(&self, d: V, n1: f64, n2: f64) -> Option<V> {
        dielectric::refract(-vec3(d), vec3(N), (n1 / n2) as f32).map(array)
    }
    fn attenuation(&self, [c1, c2, c3]: [f64; 3], d: f64) -> f64 {
        let kind = LightKind::Point {
            position: DVec3::new(0.0, d, 0.0),
            unit: PhotometricUnit::Classic,
            attenuation: Attenuation { c1, c2, c3 },
            range: f64::INFINITY,
        };
        head_on(kind)
    }
    fn spotlight(&self, exponent: f64, cutoff: f64, angle: f64) -> f64 {
        let kind = LightKind::Spot {
            position: DVec3::new(0.0, 1.0, 0.0),
            axis: DVec3::new(angle.sin(), -angle.cos(), 0.0),
            cone: Cone::Classic { exponent, cutoff },
            unit: PhotometricUnit::Classic,
            attenuation: Attenuation::default(),
            range: f64::INFINITY,
        };
        head_on(kind)
    }
    fn hemisphere(&self, tilt: f64, up: f64, down: f64) -> f64 {
        let kind = LightKind::Hemispherical { axis: DVec3::Y, down: Spectrum::gray(down as f32) };
        let light = Light::new("", Spectrum::gray(up as f32), kind);
        let emitter = Emitter::prepare(&light, DVec3::ZERO, EnvironmentShadows::Off);
        f64::from(emitter.irradiance(Vec3::new(tilt.sin() as f32, tilt.cos() as f32, 0.0)).g)
    }
}

/// What a white diffuse surface at the origin shows facing a light of intensity one.
fn head_on(kind: LightKind) -> f64 {
    let emitter = Emitter::prepare(&Light::new("", Spectrum::WHITE, kind), DVec3::ZERO, EnvironmentShadows::Off);
    emitter.incident(Vec3::ZERO).map_or(0.0, |incident| f64::from(incident.diffuse.g) / PI)
}

/// Counts what is compared and keeps what differs.
struct Table {
    tolerance: f64,
    /// Below this, values are compared by their difference alone: single precision has no such numbers.
    floor: f64,
    counted: RefCell<usize>,
    wrong: RefCell<Vec<String>>,
}

impl Table {
    fn new(tolerance: f64, floor: f64) -> Self {
        Self { tolerance, floor, counted: RefCell::default(), wrong: RefCell::default() }
    }

    fn check(&self, what: impl Fn() -> String, computed: f64, expected: f64) {
        *self.counted.borrow_mut() += 1;
        let limit = self.tolerance * expected.abs() + self.floor;
        if computed.is_nan() || (computed - expected).abs() > limit {
            self.wrong.borrow_mut().push(format!("{}: {computed:e} instead of {expected:e}", what()));
        }
    }
}

fn data() -> Value {
    let path = radiosa_testkit::data_dir().join("brdf.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("the reference data is part of the project")).expect("valid JSON")
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} is a number"))
}

fn numbers(value: &Value) -> impl Iterator<Item = f64> + '_ {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number"))
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().expect("a list").iter()
}

fn vector(value: &Value) -> V {
    let v: Vec<f64> = numbers(value).collect();
    [v[0], v[1], v[2]]
}

const SHADOWINGS: [(&str, Shadowing); 3] =
    [("vcavity", Shadowing::VCavity), ("smith", Shadowing::Smith), ("smith_correlated", Shadowing::SmithCorrelated)];

fn parse_distribution(name: &str) -> Distribution {
    match name {
        "beckmann" => Distribution::Beckmann,
        "ggx" => Distribution::Ggx,
        other => panic!("unknown distribution {other}"),
    }
}

/// Compares every directional entry of the table.
fn check_all(formulas: &dyn Formulas, data: &Value, table: &Table) {
    check_samples(formulas, data, table);
    check_fresnel(formulas, data, table);
    check_masking(formulas, data, table);
    check_refraction(formulas, data, table);
    check_lights(formulas, data, table);
}

fn check_samples(formulas: &dyn Formulas, data: &Value, table: &Table) {
    for sample in list(&data["samples"]["values"]) {
        let at = format!("θl {} θv {} φ {}", sample["theta_l"], sample["theta_v"], sample["phi_v"]);
        // Unit to the last bit: the file has 15 digits.
        let (l, v) = (exact::unit(vector(&sample["l"])), exact::unit(vector(&sample["v"])));
        // At 90° between r and v the table holds the rounding of a zero, which no other rounding repeats.
        let vanishes = number(sample, "r_dot_v").abs() < 1e-12;
        for (key, lobe) in [("phong", 0), ("blinn_phong", 1), ("lafortune_phong_brdf", 2)] {
            for (e, expected) in sample[key].as_object().expect("by exponent") {
                let exponent: f64 = e.parse().expect("an exponent");
                let expected = expected.as_f64().expect("a number");
                let computed = match lobe {
                    0 => formulas.phong(l, v, exponent),
                    1 => formulas.blinn(l, v, exponent),
                    _ => formulas.lafortune(l, v, exponent),
                };
                if vanishes && lobe != 1 {
                    table.check(|| format!("vanishing {key} {e} at {at}"), 1.0 + computed, 1.0 + expected);
                } else {
                    table.check(|| format!("{key} {e} at {at}"), computed, expected);
                }
            }
        }
        for (key, entries) in sample["cook_torrance"].as_object().expect("by distribution") {
            let (name, alpha) = key.split_once(" alpha=").expect("name and roughness");
            let (dist, alpha) = (parse_distribution(name), alpha.parse().expect("a roughness"));
            let what = |entry: &str| format!("{key} {entry} at {at}");
            let f = |g, facet, form| formulas.cook_torrance(dist, g, alpha, facet, form, l, v);
            let mut seen = 2;
            table.check(|| what("D"), formulas.d(dist, alpha, exact::half(l, v)), number(entries, "D"));
            for (name, g) in SHADOWINGS {
                table.check(|| what(name), formulas.g(dist, g, alpha, l, v), number(entries, &format!("G_{name}")));
                table.check(|| what(name), f(g, Facet::One, Form::Modern), number(entries, &format!("f_F1_{name}")));
                seen += 2;
            }
            let glass = f(Shadowing::SmithCorrelated, Facet::Dielectric(1.5), Form::Modern);
            table.check(|| what("dielectric"), glass, number(entries, "f_dielectric_1.5_smith_correlated"));
            let original = f(Shadowing::VCavity, Facet::One, Form::Paper1982);
            table.check(|| what("1982"), original, number(entries, "f_original_1982_form_F1"));
            let lecture = f(Shadowing::VCavity, Facet::One, Form::Lecture);
            table.check(|| what("lecture"), lecture, number(entries, "f_original_1982_form_F1") * l[2]);
            assert_eq!(entries.as_object().map(|e| e.len()), Some(seen + 1), "an entry of {key} is not compared");
        }
    }
}

fn check_fresnel(formulas: &dyn Formulas, data: &Value, table: &Table) {
    for (ior, entry) in data["fresnel_dielectric"].as_object().expect("by index") {
        let n: f64 = ior.parse().expect("an index");
        table.check(|| format!("F0 {ior}"), formulas.dielectric(1.0, 1.0, n), number(entry, "F0"));
        let rows = numbers(&entry["theta"])
            .zip(numbers(&entry["R_entering"]))
            .zip(numbers(&entry["R_leaving"]).zip(numbers(&entry["schlick_entering"])));
        for ((theta, entering), (leaving, schlick)) in rows {
            let cos = if theta == 90.0 { 0.0 } else { theta.to_radians().cos() };
            table.check(|| format!("entering {ior} at {theta}"), formulas.dielectric(cos, 1.0, n), entering);
            table.check(|| format!("leaving {ior} at {theta}"), formulas.dielectric(cos, n, 1.0), leaving);
            table.check(|| format!("Schlick {ior} at {theta}"), formulas.schlick(cos, number(entry, "F0")), schlick);
        }
        // At the polarising angle only one polarisation is reflected; beyond the critical angle everything is.
        let critical = number(entry, "critical_angle_leaving").to_radians();
        table.check(|| format!("beyond critical {ior}"), formulas.dielectric((critical + 1e-3).cos(), n, 1.0), 1.0);
        let brewster = number(entry, "brewster_entering").to_radians();
        let s = (n * n - 1.0) / (n * n + 1.0);
        table.check(|| format!("Brewster {ior}"), formulas.dielectric(brewster.cos(), 1.0, n), 0.5 * s * s);
    }
    for (metal, bands) in data["fresnel_conductor"]["metals"].as_object().expect("by metal") {
        for band in list(bands) {
            let (n, k) = (number(band, "n"), number(band, "k"));
            table.check(|| format!("F0 {metal}"), formulas.conductor(1.0, n, k), number(band, "F0"));
            for (theta, (r, schlick)) in numbers(&band["theta"]).zip(numbers(&band["R"]).zip(numbers(&band["schlick"]))) {
                let cos = theta.to_radians().cos();
                table.check(|| format!("{metal} at {theta}"), formulas.conductor(cos, n, k), r);
                table.check(|| format!("{metal} Schlick at {theta}"), formulas.schlick(cos, number(band, "F0")), schlick);
            }
        }
    }
}

fn check_masking(formulas: &dyn Formulas, data: &Value, table: &Table) {
    for row in list(&data["masking"]) {
        let (cos, alpha) = (number(row, "cos"), number(row, "alpha"));
        let what = || format!("masking {cos} {alpha}");
        table.check(what, formulas.g1(Distribution::Ggx, alpha, cos), number(row, "G1_ggx"));
        table.check(what, formulas.g1(Distribution::Beckmann, alpha, cos), number(row, "G1_beckmann"));
        table.check(what, formulas.g1_fit(alpha, cos), number(row, "G1_beckmann_walter2007_rational"));
    }
}

fn check_refraction(formulas: &dyn Formulas, data: &Value, table: &Table) {
    for row in list(&data["refraction"]["values"]) {
        let (n1, n2, d) = (number(row, "n1"), number(row, "n2"), vector(&row["incoming_d"]));
        let what = || format!("refraction {n1} → {n2} at {}", row["theta_i"]);
        // Components are compared against the length of the vector, one.
        let compare = |got: V, expected: V| (0..3).for_each(|i| table.check(what, got[i] + 2.0, expected[i] + 2.0));
        compare(formulas.reflect(d), vector(&row["reflected"]));
        let refracted = formulas.refract(d, n1, n2);
        assert_eq!(refracted.is_none(), row["total_internal_reflection"] == true, "{}", what());
        if let Some(t) = refracted {
            compare(t, vector(&row["refracted"]));
            table.check(what, formulas.dielectric(-d[2], n1, n2), number(row, "R"));
        }
    }
}

fn check_lights(formulas: &dyn Formulas, data: &Value, table: &Table) {
    let lights = &data["lights"];
    for row in list(&lights["attenuation"]["values"]) {
        let c = [number(row, "c1"), number(row, "c2"), number(row, "c3")];
        table.check(|| format!("attenuation {row}"), formulas.attenuation(c, number(row, "d")), number(row, "value"));
    }
    for row in list(&lights["spotlight"]["values"]) {
        let (k, cutoff) = (number(row, "exponent"), number(row, "cutoff_degrees").to_radians());
        let value = number(row, "intensity") * formulas.spotlight(k, cutoff, number(row, "angle_degrees").to_radians());
        table.check(|| format!("spotlight {row}"), value, number(row, "value"));
    }
    for row in list(&lights["hemisphere"]["values"]) {
        let value = formulas.hemisphere(number(row, "tilt").to_radians(), number(row, "Ls"), number(row, "Lg"));
        table.check(|| format!("hemisphere {row}"), value, number(row, "E"));
    }
    for row in list(&lights["spotlight"]["flux"]) {
        // ∫ I dω by Gauss's rule of two points on 20 000 rings.
        let (k, cutoff) = (number(row, "exponent"), number(row, "cutoff_degrees").to_radians());
        let n = 20_000;
        let step = cutoff / f64::from(n);
        let ring = |i: i32, at: f64| {
            let angle = (f64::from(i) + at) * step;
            formulas.spotlight(k, cutoff, angle) * angle.sin()
        };
        let gauss = [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()];
        let sum: f64 = (0..n).map(|i| 0.5 * (ring(i, gauss[0]) + ring(i, gauss[1]))).sum();
        let flux = number(row, "intensity") * 2.0 * PI * step * sum;
        table.check(|| format!("flux {row}"), flux, number(row, "flux"));
        let closed = number(row, "intensity") * exact::spotlight_flux(k, cutoff);
        assert!((closed / number(row, "flux") - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_independent_formulas_give_every_directional_entry_to_1e_9() {
    let table = Table::new(1e-9, 1e-300);
    check_all(&Exact, &data(), &table);
    let wrong = table.wrong.into_inner();
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), table.counted.into_inner());
    assert!(*table.counted.borrow() > 4000, "only {} entries were compared", table.counted.borrow());
}

#[test]
fn what_ships_gives_every_directional_entry_to_1e_4() {
    let table = Table::new(1e-4, 1e-30);
    check_all(&Shipped, &data(), &table);
    let wrong = table.wrong.into_inner();
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), table.counted.into_inner());
}

/// The independent formulas with one mistake.
struct Broken(Mistake);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    /// None: the wrapper itself changes nothing.
    None,
    /// `D` without 1/π.
    MissingPi,
    /// The two sides of an interface exchanged.
    SwappedFresnel,
    /// The 1982 form where the modern one is meant.
    OldForm,
    /// `n·h` where `r·v` is meant.
    WrongLobe,
    /// No minimum in the attenuation.
    NoMinimum,
}

impl Formulas for Broken {
    fn phong(&self, l: V, v: V, e: f64) -> f64 {
        if self.0 == Mistake::WrongLobe { Exact.blinn(l, v, e) } else { Exact.phong(l, v, e) }
    }
    fn blinn(&self, l: V, v: V, e: f64) -> f64 {
        Exact.blinn(l, v, e)
    }
    fn lafortune(&self, l: V, v: V, e: f64) -> f64 {
        Exact.lafortune(l, v, e)
    }
    fn d(&self, d: Distribution, alpha: f64, h: V) -> f64 {
        Exact.d(d, alpha, h) * if self.0 == Mistake::MissingPi { PI } else { 1.0 }
    }
    fn g(&self, d: Distribution, g: Shadowing, alpha: f64, l: V, v: V) -> f64 {
        Exact.g(d, g, alpha, l, v)
    }
    fn g1(&self, d: Distribution, alpha: f64, cos: f64) -> f64 {
        Exact.g1(d, alpha, cos)
    }
    fn g1_fit(&self, alpha: f64, cos: f64) -> f64 {
        Exact.g1_fit(alpha, cos)
    }
    fn cook_torrance(&self, d: Distribution, g: Shadowing, alpha: f64, f: Facet, form: Form, l: V, v: V) -> f64 {
        let form = if self.0 == Mistake::OldForm { Form::Paper1982 } else { form };
        Exact.cook_torrance(d, g, alpha, f, form, l, v)
    }
    fn dielectric(&self, cos: f64, n1: f64, n2: f64) -> f64 {
        if self.0 == Mistake::SwappedFresnel { Exact.dielectric(cos, n2, n1) } else { Exact.dielectric(cos, n1, n2) }
    }
    fn conductor(&self, cos: f64, n: f64, k: f64) -> f64 {
        if self.0 == Mistake::SwappedFresnel { Exact.conductor(cos, k, n) } else { Exact.conductor(cos, n, k) }
    }
    fn schlick(&self, cos: f64, f0: f64) -> f64 {
        Exact.schlick(cos, f0)
    }
    fn reflect(&self, d: V) -> V {
        Exact.reflect(d)
    }
    fn refract(&self, d: V, n1: f64, n2: f64) -> Option<V> {
        Exact.refract(d, n1, n2)
    }
    fn attenuation(&self, c: [f64; 3], d: f64) -> f64 {
        if self.0 == Mistake::NoMinimum { 1.0 / (c[0] + c[1] * d + c[2] * d * d) } else { Exact.attenuation(c, d) }
    }
    fn spotlight(&self, k: f64, cutoff: f64, angle: f64) -> f64 {
        Exact.spotlight(k, cutoff, angle)
    }
    fn hemisphere(&self, tilt: f64, up: f64, down: f64) -> f64 {
        Exact.hemisphere(tilt, up, down)
    }
}

#[test]
fn a_wrong_formula_is_caught() {
    let data = data();
    // At the looser of the two tolerances.
    let n_wrong = |mistake| {
        let table = Table::new(1e-4, 1e-30);
        check_all(&Broken(mistake), &data, &table);
        table.wrong.into_inner().len()
    };
    assert_eq!(n_wrong(Mistake::None), 0);
    for (mistake, at_least) in [
        (Mistake::MissingPi, 200),
        (Mistake::SwappedFresnel, 60),
        (Mistake::OldForm, 500),
        (Mistake::WrongLobe, 50),
        (Mistake::NoMinimum, 5),
    ] {
        let n = n_wrong(mistake);
        assert!(n >= at_least, "{mistake:?} broke only {n} entries");
    }
}

/// `∫ D (n·h) dω` and `∫ D dω` for a distribution about `width` wide, by the midpoint rule in `t = tan θ = width s/(1 − s)`.
fn integrals_of_d(d: &dyn Fn(V) -> f64, width: f64, n: u32) -> (f64, f64) {
    let (mut with_cos, mut without) = (0.0, 0.0);
    for i in 0..n {
        let s = (f64::from(i) + 0.5) / f64::from(n);
        let t = width * s / (1.0 - s);
        let dt = width / (1.0 - s).powi(2) / f64::from(n);
        let cos = 1.0 / (1.0 + t * t).sqrt();
        // dω = 2π sin θ dθ, dθ = cos² θ dt.
        let value = d([t * cos, 0.0, cos]) * 2.0 * PI * t * cos.powi(3) * dt;
        with_cos += value * cos;
        without += value;
    }
    (with_cos, without)
}

#[test]
fn distributions_are_normalised() {
    let data = data();
    for row in list(&data["normalisation_of_D"]["values"]) {
        let name = row["D"].as_str().expect("a name");
        if name == "blinn-phong" {
            let (e, alpha) = (number(row, "exponent"), number(row, "equivalent_alpha"));
            assert!(((2.0 / (e + 2.0)).sqrt() - alpha).abs() < 1e-12);
            for (formulas, limit) in [(&Exact as &dyn Formulas, 1e-6), (&Shipped, 1e-5)] {
                // With light and viewer both at h, the halfway vector is h.
                let d = |h: V| (e + 2.0) / (2.0 * PI) * formulas.blinn(h, h, e);
                let (with_cos, _) = integrals_of_d(&d, alpha, 4_000);
                assert!((with_cos - number(row, "int_D_cos")).abs() < limit, "{row}: {with_cos}");
            }
            continue;
        }
        let (d, alpha) = (parse_distribution(name), number(row, "alpha"));
        let (with_cos, without) = integrals_of_d(&|h| Exact.d(d, alpha, h), alpha, 20_000);
        assert!((with_cos - number(row, "int_D_cos")).abs() < 1e-7, "{row}: {with_cos}");
        assert!((without / number(row, "int_D") - 1.0).abs() < 1e-7, "{row}: {without}");
        assert!((Exact.d(d, alpha, N) / number(row, "D_at_normal") - 1.0).abs() < 1e-9);
        let (with_cos, without) = integrals_of_d(&|h| Shipped.d(d, alpha, h), alpha, 4_000);
        assert!((with_cos - 1.0).abs() < 1e-5, "{row}: {with_cos}");
        assert!((without / number(row, "int_D") - 1.0).abs() < 1e-5, "{row}: {without}");
    }
    let broken = Broken(Mistake::MissingPi);
    let (without_pi, _) = integrals_of_d(&|h| broken.d(Distribution::Ggx, 0.3, h), 0.3, 4_000);
    assert!((without_pi - PI).abs() < 1e-3);
}

/// `∫ f cos θ dω` for a viewer at `theta`, by the midpoint rule over directions drawn around the lobe.
fn directional_albedo(row: &Value, formulas: &dyn Formulas, theta: f64, n: u32) -> f64 {
    let v = [theta.sin(), 0.0, theta.cos()];
    let model = row["model"].as_str().expect("a name");
    let sphere = |cos: f64, phi: f64| {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        [sin * phi.cos(), sin * phi.sin(), cos]
    };
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            // Drawn more densely towards the tail of the lobe, where the horizon cuts it: u = 1 − (1 − s)³.
            let rest = 1.0 - (f64::from(i) + 0.5) / f64::from(n);
            let (u, du) = (1.0 - rest.powi(3), 3.0 * rest * rest);
            // The integrand is symmetric about the plane of incidence: half the circle will do.
            let phi = (f64::from(j) + 0.5) / f64::from(n) * PI;
            let (l, value_over_pdf): (V, &dyn Fn(V) -> f64);
            let (about_h, e, cook);
            if model == "cook-torrance" {
                let d = parse_distribution(row["D"].as_str().expect("a name"));
                let alpha = number(row, "alpha");
                let tan2 = match d {
                    Distribution::Beckmann => -alpha * alpha * (1.0 - u).ln(),
                    Distribution::Ggx => alpha * alpha * u / (1.0 - u),
                };
                let h = sphere(1.0 / (1.0 + tan2).sqrt(), phi);
                l = exact::add(v.map(|x| -x), 2.0 * exact::dot(v, h), h);
                let g = SHADOWINGS.iter().find(|s| row["G"] == s.0).expect("a shadowing").1;
                let facet = match row["fresnel"].as_str().expect("a name") {
                    "F=1" => Facet::One,
                    "dielectric n=1.5" => Facet::Dielectric(1.5),
                    "schlick F0=0.04" => Facet::Schlick(0.04),
                    "Au at 0.6595 um" => Facet::Conductor(0.14, 3.697),
                    "Au at 0.5486 um" => Facet::Conductor(0.43, 2.455),
                    "Au at 0.4509 um" => Facet::Conductor(1.38, 1.914),
                    other => panic!("unknown Fresnel term {other}"),
                };
                cook = move |l: V| {
                    let pdf = exact::d(d, alpha, h[2]) * h[2] / (4.0 * exact::dot(v, h));
                    formulas.cook_torrance(d, g, alpha, facet, Form::Modern, l, v) * l[2] / pdf
                };
                value_over_pdf = &cook;
            } else {
                e = number(row, "exponent");
                let cos = (1.0 - u).powf(1.0 / (e + 1.0));
                if model.starts_with("phong") {
                    // Around the mirror direction, in a frame that keeps the plane of incidence.
                    let w = sphere(cos, phi);
                    let (s, c) = (-theta.sin(), theta.cos());
                    l = [w[0] * c + w[2] * s, w[1], w[2] * c - w[0] * s];
                    about_h =
                        Box::new(move |l: V| formulas.phong(l, v, e) * l[2] * 2.0 * PI / ((e + 1.0) * exact::phong(N, l, v, e)))
                            as Box<dyn Fn(V) -> f64>;
                } else {
                    let h = sphere(cos, phi);
                    l = exact::add(v.map(|x| -x), 2.0 * exact::dot(v, h), h);
                    about_h = Box::new(move |l: V| {
                        let pdf = (e + 1.0) / (2.0 * PI) * h[2].powf(e) / (4.0 * exact::dot(v, h));
                        formulas.blinn(l, v, e) * l[2] / pdf
                    });
                }
                value_over_pdf = &*about_h;
            }
            let l = exact::unit(l);
            if l[2] > 0.0 && exact::dot(l, v) > -0.999_999 {
                let value = value_over_pdf(l);
                // A lobe too faint for any precision has no density to divide by.
                sum += if value.is_finite() { value * du } else { 0.0 };
            }
        }
    }
    sum / f64::from(n * n)
}

#[test]
fn directional_albedos_follow_from_the_formulas() {
    // The midpoint rule meets a kink at the horizon; its error over n² nodes was seen to be below these bounds.
    let data = data();
    let mut worst = (0f64, 0f64);
    for row in list(&data["directional_albedo"]["values"]) {
        for (theta, expected) in numbers(&row["theta"]).zip(numbers(&row["value"])) {
            let theta = theta.to_radians();
            let fine = (directional_albedo(row, &Exact, theta, 128) - expected).abs() / expected;
            let shipped = (directional_albedo(row, &Shipped, theta, 48) - expected).abs() / expected;
            worst = (worst.0.max(fine), worst.1.max(shipped));
            assert!(fine < 2e-3, "{row} at {theta}: off by {fine:e}");
            assert!(shipped < 5e-3, "{row} at {theta}: off by {shipped:e}");
        }
    }
    eprintln!("largest relative error: {:.1e} (f64, 128² nodes), {:.1e} (f32, 48² nodes)", worst.0, worst.1);
}

#[test]
fn the_overcast_sky_lights_as_its_formula_says() {
    // L(θ) = L_z (1 + 2 cos θ)/3 above the horizon, black below, as a map.
    let (w, h) = (64, 256);
    let texel = |y: u32| {
        let cos = (PI * (f64::from(y) + 0.5) / f64::from(h)).cos();
        Spectrum::gray(if cos > 0.0 { ((1.0 + 2.0 * cos) / 3.0) as f32 } else { 0.0 })
    };
    let map = Map::new(w, h, (0..h).flat_map(|y| (0..w).map(move |_| texel(y)))).expect("a whole map");
    let sky = Sky::of_map(map);
    let hemisphere = &data()["lights"]["hemisphere"];
    let horizontal = sky.irradiance(DVec3::Y)[1];
    assert!((horizontal / number(hemisphere, "cie_overcast_value_Lz_1") - 1.0).abs() < 1e-4, "{horizontal}");
    let ratio = sky.irradiance(DVec3::X)[1] / horizontal;
    assert!((ratio / number(hemisphere, "cie_overcast_vertical_over_horizontal") - 1.0).abs() < 1e-3, "{ratio}");
}
