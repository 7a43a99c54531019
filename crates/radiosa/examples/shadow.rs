//! What discontinuity meshing is worth: errors of the irradiance under a blocker against the closed form, at equal numbers of elements: `shadow [SIZE…]`, edges of elements in metres.

#[path = "../tests/common/shadow.rs"]
mod shadow;

use radiosa::math::DVec3;
use shadow::{Errors, Refine, Shadow, adaptive, uniform};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<f64> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let sizes = if words.is_empty() { vec![0.4, 0.2, 0.1] } else { words };
    println!("L1 errors, % of the mean irradiance: means of elements; points, one value an element; points, as shown");
    for of in [Shadow::new("aligned", 0.5, 0.0), Shadow::new("turned", 0.5, 25.0), Shadow::new("turned, small light", 0.1, 25.0)]
    {
        for &size in &sizes {
            let print = |what: &str, e: Errors| {
                let [a, b, c] = [e.of_elements, e.flat, e.shown].map(|e| 100.0 * e);
                println!("{:20} {size:<5} {what:30} {:6} {a:8.3} {b:8.3} {c:8.3}", of.name, e.n);
            };
            let lines = of.errors(&of.solve(size, 1, Refine::default()));
            print("uniform", of.errors(&uniform(&of, lines.n)));
            for (levels, coarser) in [(1, 1.5), (2, 2.0), (3, 3.0)] {
                print(&format!("quadtree, {levels} levels"), of.errors(&adaptive(&of, size * coarser, levels, lines.n)));
            }
            print("discontinuities", lines);
            print("the same lines, half an element aside", of.errors(&of.solve_moved(size, DVec3::new(0.5, 0.0, 0.5) * size)));
        }
    }
    Ok(())
}
