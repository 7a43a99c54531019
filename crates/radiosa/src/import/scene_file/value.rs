//! The values a scene file is made of. Each checks itself while it is read, so that every error points at the value.

use std::fmt;
use std::ops::Range;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use crate::math::{DVec3, Vec2};
use crate::spectrum::Spectrum;

/// No number may be larger: squares of lengths must still fit single precision.
const LARGEST: f64 = 1e18;

/// Reads one number and checks it.
struct NumberVisitor {
    what: &'static str,
    holds: fn(f64) -> bool,
}

impl Visitor<'_> for NumberVisitor {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.what)
    }

    fn visit_f64<E: de::Error>(self, v: f64) -> Result<f64, E> {
        if !v.is_finite() || v.abs() > LARGEST {
            Err(E::custom(format!("{v} is out of range: numbers must be finite and at most {LARGEST:e}")))
        } else if (self.holds)(v) {
            Ok(v)
        } else {
            Err(E::custom(format!("{v} is not {}", self.what)))
        }
    }

    fn visit_i64<E: de::Error>(self, v: i64) -> Result<f64, E> {
        #[expect(clippy::cast_precision_loss, reason = "whole numbers above 2^53 are rounded like any other decimal")]
        self.visit_f64(v as f64)
    }

    fn visit_u64<E: de::Error>(self, v: u64) -> Result<f64, E> {
        #[expect(clippy::cast_precision_loss, reason = "as above")]
        self.visit_f64(v as f64)
    }
}

macro_rules! numbers {
    ($($(#[$doc:meta])* $name:ident: $what:literal, $holds:expr, $schema:tt;)*) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub(super) struct $name(pub(super) f64);

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(NumberVisitor { what: $what, holds: $holds }).map(Self)
            }
        }

        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!($schema)
            }
        }
    )* };
}

numbers! {
    /// Any finite number.
    Number: "a number", |_| true, { "type": "number" };
    /// Above zero.
    Positive: "a number above zero", |x| x > 0.0, { "type": "number", "exclusiveMinimum": 0 };
    /// Zero or more.
    NonNegative: "a number of zero or more", |x| x >= 0.0, { "type": "number", "minimum": 0 };
    /// From zero to one.
    Fraction: "a number from 0 to 1", |x| (0.0..=1.0).contains(&x), { "type": "number", "minimum": 0, "maximum": 1 };
    /// A unit of length in metres: bounded so that products with coordinates stay representable.
    Unit: "a number from 1e-9 to 1e9", |x| (1e-9..=1e9).contains(&x), { "type": "number", "minimum": 1e-9, "maximum": 1e9 };
    /// Highlights sharper than this are mirrors.
    Exponent: "an exponent from 0 to 1e6", |x| (0.0..=1e6).contains(&x), { "type": "number", "minimum": 0, "maximum": 1e6 };
    /// Full opening of a camera, degrees.
    FieldOfView: "an angle above 0 and below 180 degrees", |x| x > 0.0 && x < 180.0, { "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 180 };
    /// Half opening of a cone, degrees.
    HalfAngle: "an angle from 0 to 180 degrees", |x| (0.0..=180.0).contains(&x), { "type": "number", "minimum": 0, "maximum": 180 };
    /// An index of refraction.
    Index: "an index of refraction from 0.01 to 100", |x| (0.01..=100.0).contains(&x), { "type": "number", "minimum": 0.01, "maximum": 100 };
    /// The mean cosine of scattering: nearer to ±1 single precision does not tell directions apart.
    Asymmetry: "a number from -0.99 to 0.99", |x| x.abs() <= 0.99, { "type": "number", "minimum": -0.99, "maximum": 0.99 };
    /// How finely a round shape is cut.
    Segments: "a whole number from 3 to 1024", |x| x.fract() == 0.0 && (3.0..=1024.0).contains(&x), { "type": "integer", "minimum": 3, "maximum": 1024 };
    /// How many directions stand for an environment.
    DirectionCount: "a whole number from 1 to 65536", |x| x.fract() == 0.0 && (1.0..=65536.0).contains(&x), { "type": "integer", "minimum": 1, "maximum": 65536 };
    /// A set of texture coordinates.
    UvSet: "a whole number from 0 to 255", |x| x.fract() == 0.0 && (0.0..=255.0).contains(&x), { "type": "integer", "minimum": 0, "maximum": 255 };
    /// An index of a vertex.
    VertexIndex: "a whole number of zero or more", |x| x.fract() == 0.0 && (0.0..=4_294_967_294.0).contains(&x), { "type": "integer", "minimum": 0 };
    /// Nested dielectrics.
    Priority: "a whole number from -1000 to 1000", |x| x.fract() == 0.0 && x.abs() <= 1000.0, { "type": "integer", "minimum": -1000, "maximum": 1000 };
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the constructors hold whole numbers in range")]
impl Segments {
    pub(super) fn get(self) -> u32 {
        self.0 as u32
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the constructors hold whole numbers in range")]
impl VertexIndex {
    pub(super) fn get(self) -> u32 {
        self.0 as u32
    }
}

/// Exactly `N` numbers.
struct Tuple<const N: usize>(&'static str);

impl<'de, const N: usize> Visitor<'de> for Tuple<N> {
    type Value = [f64; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<[f64; N], A::Error> {
        let mut values = [0.0; N];
        let mut n = 0;
        while let Some(Number(v)) = seq.next_element()? {
            if n < N {
                values[n] = v;
            }
            n += 1;
        }
        if n == N { Ok(values) } else { Err(de::Error::custom(format!("expected {}, found {n} of them", self.0))) }
    }
}

macro_rules! tuples {
    ($($(#[$doc:meta])* $name:ident($inner:ty): $n:literal, $what:literal, $convert:expr;)*) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub(super) struct $name(pub(super) $inner);

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let values = deserializer.deserialize_any(Tuple::<$n>($what))?;
                let convert: fn([f64; $n]) -> Result<$inner, &'static str> = $convert;
                convert(values).map(Self).map_err(de::Error::custom)
            }
        }

        impl JsonSchema for $name {
            fn inline_schema() -> bool {
                true
            }
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "array", "items": { "type": "number" }, "minItems": $n, "maxItems": $n })
            }
        }
    )* };
}

tuples! {
    /// A place, in the file's units.
    Point(DVec3): 3, "three numbers [x, y, z]", |v| Ok(DVec3::from_array(v));
    /// A direction of any length above zero; kept at unit length.
    Direction(DVec3): 3, "three numbers [x, y, z]", |v| DVec3::from_array(v).try_normalize().ok_or("a direction must not be [0, 0, 0]");
    /// Texture coordinates.
    Pair(Vec2): 2, "two numbers [u, v]", |v| Ok(crate::math::DVec2::from_array(v).as_vec2());
    /// `c1`, `c2`, `c3`.
    Falloff([f64; 3]): 3, "three numbers [c1, c2, c3]", |v| {
        if v.iter().all(|&c| c >= 0.0) && v.iter().any(|&c| c > 0.0) { Ok(v) } else { Err("attenuation needs numbers of zero or more, one of them above zero") }
    };
    /// One row of an affine matrix.
    Row([f64; 4]): 4, "four numbers", Ok;
}

/// One number for all axes or one for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale(pub(super) DVec3);

impl<'de> Deserialize<'de> for Scale {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct V;
        const WHAT: &str = "a number or three numbers [x, y, z]";
        impl<'de> Visitor<'de> for V {
            type Value = DVec3;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(WHAT)
            }
            fn visit_f64<E: de::Error>(self, v: f64) -> Result<DVec3, E> {
                NumberVisitor { what: WHAT, holds: |_| true }.visit_f64(v).map(DVec3::splat)
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<DVec3, E> {
                NumberVisitor { what: WHAT, holds: |_| true }.visit_i64(v).map(DVec3::splat)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<DVec3, A::Error> {
                Tuple::<3>(WHAT).visit_seq(seq).map(DVec3::from_array)
            }
        }
        let v = deserializer.deserialize_any(V)?;
        if v.to_array().iter().all(|c| (1e-9..=1e9).contains(&c.abs())) {
            Ok(Self(v))
        } else {
            Err(de::Error::custom("scales must lie between 1e-9 and 1e9 in size"))
        }
    }
}

impl JsonSchema for Scale {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Scale".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "number" },
            { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
        ] })
    }
}

/// Linear RGB: one number for grey, `[r, g, b]`, or `"#rrggbb"` (sRGB, as colour pickers give it).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Color(pub(super) Spectrum);

const COLOR: &str = "a colour: a number, [r, g, b] or \"#rrggbb\"";

/// Reads a [`Color`]; also the part of richer values that may be just a colour.
struct ColorVisitor;

fn channel<E: de::Error>(v: f64) -> Result<f32, E> {
    #[expect(clippy::cast_possible_truncation, reason = "colours are kept in single precision")]
    NumberVisitor { what: "a colour: its channels are zero or more", holds: |x| x >= 0.0 }.visit_f64(v).map(|v| v as f32)
}

/// Decodes one byte of sRGB (IEC 61966-2-1).
fn srgb(byte: u8) -> f32 {
    let v = f32::from(byte) / 255.0;
    if v <= 0.040_45 { v / 12.92 } else { crate::math::function::pow((v + 0.055) / 1.055, 2.4) }
}

impl<'de> Visitor<'de> for ColorVisitor {
    type Value = Spectrum;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(COLOR)
    }

    fn visit_f64<E: de::Error>(self, v: f64) -> Result<Spectrum, E> {
        channel(v).map(Spectrum::gray)
    }

    fn visit_i64<E: de::Error>(self, v: i64) -> Result<Spectrum, E> {
        #[expect(clippy::cast_precision_loss, reason = "rounded like any other decimal")]
        self.visit_f64(v as f64)
    }

    fn visit_str<E: de::Error>(self, v: &str) -> Result<Spectrum, E> {
        let hex = v.strip_prefix('#').filter(|h| h.len() == 6 && h.bytes().all(|b| b.is_ascii_hexdigit()));
        let Some(hex) = hex else { return Err(E::custom(format!("{v:?} is not {COLOR}"))) };
        let byte = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).map(srgb).map_err(E::custom);
        Ok(Spectrum::new(byte(0)?, byte(2)?, byte(4)?))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Spectrum, A::Error> {
        let [r, g, b] = Tuple::<3>("three numbers [r, g, b]").visit_seq(seq)?;
        Ok(Spectrum::new(channel(r)?, channel(g)?, channel(b)?))
    }
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ColorVisitor).map(Self)
    }
}

impl JsonSchema for Color {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Color".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Linear RGB: one number for grey, [r, g, b], or \"#rrggbb\" (sRGB, as colour pickers give it).",
            "anyOf": [
                { "type": "number", "minimum": 0 },
                { "type": "array", "items": { "type": "number", "minimum": 0 }, "minItems": 3, "maxItems": 3 },
                { "type": "string", "pattern": "^#[0-9a-fA-F]{6}$" },
            ],
        })
    }
}

/// A plain value where that is enough, a table where more is to be said.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum OrTable<V, T> {
    /// Just the value.
    Plain(V),
    /// The table.
    Table(T),
}

/// What a plain value must bring so that a table may stand in its place.
pub(super) trait Plain: Sized {
    /// Reads anything that is not a table.
    fn visitor<'de>() -> impl Visitor<'de, Value = Self>;
}

impl Plain for Spectrum {
    fn visitor<'de>() -> impl Visitor<'de, Value = Self> {
        ColorVisitor
    }
}

impl Plain for f64 {
    fn visitor<'de>() -> impl Visitor<'de, Value = Self> {
        NumberVisitor { what: "a number of zero or more", holds: |x| x >= 0.0 }
    }
}

impl Plain for String {
    fn visitor<'de>() -> impl Visitor<'de, Value = Self> {
        struct V;
        impl Visitor<'_> for V {
            type Value = String;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a string")
            }
            fn visit_str<E: de::Error>(self, v: &str) -> Result<String, E> {
                Ok(v.to_owned())
            }
        }
        V
    }
}

impl<'de, V: Plain, T: Deserialize<'de>> Deserialize<'de> for OrTable<V, T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either<V, T>(std::marker::PhantomData<(V, T)>);
        impl<'de, V: Plain, T: Deserialize<'de>> Visitor<'de> for Either<V, T> {
            type Value = OrTable<V, T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                V::visitor().expecting(f)?;
                f.write_str(", or a table")
            }
            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Self::Value, E> {
                V::visitor().visit_f64(v).map(OrTable::Plain)
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Self::Value, E> {
                V::visitor().visit_i64(v).map(OrTable::Plain)
            }
            fn visit_str<E: de::Error>(self, v: &str) -> Result<Self::Value, E> {
                V::visitor().visit_str(v).map(OrTable::Plain)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                V::visitor().visit_seq(seq).map(OrTable::Plain)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(de::value::MapAccessDeserializer::new(map)).map(OrTable::Table)
            }
        }
        deserializer.deserialize_any(Either(std::marker::PhantomData))
    }
}

/// A colour, or a table that adds a texture to it.
impl<T: JsonSchema> JsonSchema for OrTable<Spectrum, T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("ColorOr{}", T::schema_name()).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let (color, table) = (generator.subschema_for::<Color>(), generator.subschema_for::<T>());
        json_schema!({ "anyOf": [color, table] })
    }
}

impl<T: JsonSchema> JsonSchema for OrTable<f64, T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("NumberOr{}", T::schema_name()).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = generator.subschema_for::<T>();
        json_schema!({ "anyOf": [{ "type": "number", "minimum": 0 }, table] })
    }
}

impl<T: JsonSchema> JsonSchema for OrTable<String, T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("StringOr{}", T::schema_name()).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = generator.subschema_for::<T>();
        json_schema!({ "anyOf": [{ "type": "string" }, table] })
    }
}

/// One value, or an array of them.
#[derive(Clone, Debug)]
pub(super) struct OneOrMany<T>(pub(super) Vec<At<T>>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OneOrMany<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        enum Shape<T> {
            One(T),
            Many(Vec<At<T>>),
        }
        struct Either<T>(std::marker::PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
            type Value = Shape<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table, or an array of tables")
            }
            fn visit_str<E: de::Error>(self, v: &str) -> Result<Self::Value, E> {
                T::deserialize(de::value::StrDeserializer::new(v)).map(Shape::One)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut all = Vec::new();
                while let Some(item) = seq.next_element()? {
                    all.push(item);
                }
                Ok(Shape::Many(all))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(de::value::MapAccessDeserializer::new(map)).map(Shape::One)
            }
        }
        struct Whole<T>(Shape<T>);
        impl<'de, T: Deserialize<'de>> Deserialize<'de> for Whole<T> {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(Either(std::marker::PhantomData)).map(Self)
            }
        }
        let At { value: Whole(shape), span } = At::<Whole<T>>::deserialize(deserializer)?;
        Ok(Self(match shape {
            Shape::One(value) => vec![At { value, span }],
            Shape::Many(all) => all,
        }))
    }
}

impl<T> Default for OneOrMany<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: JsonSchema> JsonSchema for OneOrMany<T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("OneOrMany{}", T::schema_name()).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<T>();
        json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}

/// A value and the bytes of the file it was read from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct At<T> {
    /// The value.
    pub(super) value: T,
    /// Where it stands.
    pub(super) span: Range<usize>,
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for At<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let spanned = toml::Spanned::<T>::deserialize(deserializer)?;
        let span = spanned.span();
        Ok(Self { value: spanned.into_inner(), span })
    }
}

impl<T: JsonSchema> JsonSchema for At<T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        T::schema_name()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        generator.subschema_for::<T>()
    }
}

/// A table of named things, in the order of the file.
#[derive(Clone, Debug)]
pub(super) struct Named<T>(pub(super) Vec<(At<String>, T)>);

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Named<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct V<T>(std::marker::PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for V<T> {
            type Value = Vec<(At<String>, T)>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of named tables, such as [material.white]")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut all = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    all.push(entry);
                }
                Ok(all)
            }
        }
        let mut all = deserializer.deserialize_any(V(std::marker::PhantomData))?;
        // The parser sorts keys by name; where they stand in the file is what counts.
        all.sort_by_key(|(name, _)| name.span.start);
        Ok(Self(all))
    }
}

impl<T: JsonSchema> JsonSchema for Named<T> {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("Named{}", T::schema_name()).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<T>();
        json_schema!({ "type": "object", "additionalProperties": one })
    }
}
