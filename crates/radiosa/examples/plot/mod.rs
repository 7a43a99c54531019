//! Plots with logarithmic axes, as SVG.

use std::fmt::{Arguments, Write};

/// A picture on its way.
pub(crate) struct Svg(String);

impl Svg {
    /// White, of a size in its own units.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        ))
    }

    /// One more element.
    pub(crate) fn add(&mut self, text: Arguments) {
        // A string takes everything.
        let _ = self.0.write_fmt(text);
        self.0.push('\n');
    }

    /// The whole.
    pub(crate) fn finish(mut self) -> String {
        self.0.push_str("</svg>\n");
        self.0
    }

    /// Lines of powers of ten, their names, and what they are.
    pub(crate) fn axes(&mut self, axes: &Axes, title: &str) {
        let ([left, right], [top, bottom]) = (axes.x, axes.y);
        let (across, up) = (axes.decades[0], axes.decades[1]);
        for k in across[0]..=across[1] {
            let [x, _] = axes.at([10f64.powi(k), 1.0]);
            self.add(format_args!("<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top}\" y2=\"{bottom}\" stroke=\"#ddd\"/>"));
            self.add(format_args!("<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>", bottom + 18.0, power(k)));
        }
        for k in up[0]..=up[1] {
            let [_, y] = axes.at([1.0, 10f64.powi(k)]);
            self.add(format_args!("<line x1=\"{left}\" x2=\"{right:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ddd\"/>"));
            self.add(format_args!("<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", left - 6.0, y + 4.0, power(k)));
        }
        let middle = 0.5 * (left + right);
        self.add(format_args!("<text x=\"{middle:.1}\" y=\"{}\" text-anchor=\"middle\">{title}</text>", bottom + 38.0));
    }

    /// What a curve of a colour is, from `x` on.
    pub(crate) fn legend(&mut self, x: f64, y: f64, color: &str, name: &str) {
        self.add(format_args!(
            "<line x1=\"{x}\" x2=\"{:.0}\" y1=\"{y}\" y2=\"{y}\" stroke=\"{color}\" stroke-width=\"3\"/>",
            x + 22.0
        ));
        self.add(format_args!("<text x=\"{:.0}\" y=\"{:.0}\">{name}</text>", x + 28.0, y + 4.0));
    }
}

/// Where a plot lies in the picture, and the powers of ten it shows.
pub(crate) struct Axes {
    pub(crate) x: [f64; 2],
    pub(crate) y: [f64; 2],
    pub(crate) decades: [[i32; 2]; 2],
}

impl Axes {
    pub(crate) fn at(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let along = |v: f64, [from, to]: [i32; 2]| (v.log10() - f64::from(from)) / f64::from(to - from);
        [
            self.x[0] + along(u, self.decades[0]) * (self.x[1] - self.x[0]),
            self.y[1] - along(v, self.decades[1]) * (self.y[1] - self.y[0]),
        ]
    }
}

fn power(k: i32) -> String {
    let digit = |d: char| ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][d as usize - '0' as usize];
    let digits: String = k.abs().to_string().chars().map(digit).collect();
    match k {
        0 => "1".into(),
        1 => "10".into(),
        _ => format!("10{}{digits}", if k < 0 { "⁻" } else { "" }),
    }
}
