//! Values of options that are more than a word or a number.

use std::str::FromStr;
use std::time::Duration;

/// Picture size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let (w, h) = s.split_once(['x', 'X', '×']).ok_or("write it as WIDTHxHEIGHT, such as 800x600")?;
        let side = |t: &str| match t.trim().parse::<u32>() {
            Ok(n @ 1..=65536) => Ok(n),
            _ => Err(format!("{t:?} is not a number of pixels from 1 to 65536")),
        };
        Ok(Self { width: side(w)?, height: side(h)? })
    }
}

/// `--emitters`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Emitters {
    Ignore,
    Sample(u32),
}

impl FromStr for Emitters {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match (s, s.parse::<u32>()) {
            ("ignore", _) => Ok(Self::Ignore),
            (_, Ok(n @ 1..=64)) => Ok(Self::Sample(n)),
            _ => Err("give a number from 1 to 64, or \"ignore\"".into()),
        }
    }
}

/// `--exposure`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Exposure {
    Auto,
    Factor(f32),
}

impl FromStr for Exposure {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        match (s, s.parse::<f32>()) {
            ("auto", _) => Ok(Self::Auto),
            (_, Ok(f)) if f.is_finite() && f > 0.0 => Ok(Self::Factor(f)),
            _ => Err("give a factor above zero, or \"auto\"".into()),
        }
    }
}

pub(crate) fn parse_color(s: &str) -> Result<[f32; 3], String> {
    let values: Vec<f32> = s
        .split(',')
        .map(|t| t.trim().parse::<f32>().ok().filter(|v| v.is_finite() && *v >= 0.0))
        .collect::<Option<_>>()
        .ok_or("give one number, or three separated by commas, none negative")?;
    match values[..] {
        [v] => Ok([v; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err("give one number, or three separated by commas".into()),
    }
}

pub(crate) fn parse_noise(s: &str) -> Result<f64, String> {
    s.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| "give an error above zero, such as 0.02".into())
}

pub(crate) fn parse_scale(s: &str) -> Result<f64, String> {
    s.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| "give a number above zero".into())
}

pub(crate) fn parse_duration(s: &str) -> Result<Duration, String> {
    let advice = || "give a duration such as 30s, 2m or 1h".to_owned();
    let split = s.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(s.len());
    let factor = match &s[split..] {
        "" | "s" => 1.0,
        "ms" => 1e-3,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(advice()),
    };
    let value: f64 = s[..split].parse().map_err(|_| advice())?;
    Duration::try_from_secs_f64(value * factor).map_err(|_| advice())
}

pub(crate) fn parse_range(s: &str) -> Result<(f64, f64), String> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    match s.split_once(',').map(|(low, high)| (number(low), number(high))) {
        Some((Some(low), Some(high))) if low < high => Ok((low, high)),
        _ => Err("give two numbers from zero, the lower one first, such as 0,500".into()),
    }
}

pub(crate) fn parse_memory(s: &str) -> Result<u64, String> {
    let advice = || "give a size such as 500M or 4G".to_owned();
    let split = s.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(s.len());
    let shift = match s[split..].to_ascii_uppercase().trim_end_matches("IB").trim_end_matches('B') {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err(advice()),
    };
    let value: f64 = s[..split].parse().map_err(|_| advice())?;
    if value.is_finite() && value > 0.0 { Ok((value * (1u64 << shift) as f64) as u64) } else { Err(advice()) }
}

pub(crate) fn parse_pixel(s: &str) -> Result<[u32; 2], String> {
    let number = |t: &str| t.trim().parse::<u32>().ok();
    let pixel = s.split_once(',').and_then(|(x, y)| number(x).zip(number(y)));
    pixel.map(|(x, y)| [x, y]).ok_or_else(|| "give a column and a row of the picture from 0, such as 320,240".into())
}

/// A number from 0 to 1, or a quotient such as 1/256.
pub(crate) fn parse_fraction(s: &str) -> Result<f32, String> {
    let number = |t: &str| t.trim().parse::<f32>().ok();
    let value = match s.split_once('/') {
        Some((a, b)) => number(a).zip(number(b)).map(|(a, b)| a / b),
        None => number(s),
    };
    value.filter(|v| (0.0..=1.0).contains(v)).ok_or_else(|| "give a number from 0 to 1, such as 0.1 or 1/256".into())
}
