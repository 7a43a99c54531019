//! Runs the same rays through both, taking turns, and prints a table.

use std::fmt::Write as _;
use std::hint::black_box;

use radiosa::accel::{Accel, Occluder};
use radiosa::math::Ray;

use crate::embree::Embree;
use crate::rays::Rays;

/// One way to answer one kind of rays: how many hits, over a part of the rays.
type Run<'a> = Box<dyn Fn(usize, usize) -> usize + Sync + 'a>;

/// A contestant in a row.
pub struct Column<'a> {
    name: &'static str,
    run: Run<'a>,
}

/// Rays of a kind, and who answers them. Ratios are to the first column.
pub struct Row<'a> {
    pub name: &'static str,
    n_rays: usize,
    columns: Vec<Column<'a>>,
}

/// CPU time of the calling thread, seconds.
fn cpu_time() -> f64 {
    #[repr(C)]
    struct Timespec {
        seconds: i64,
        nanoseconds: i64,
    }
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut Timespec) -> i32;
    }
    const THREAD: i32 = 3;
    let mut t = Timespec { seconds: 0, nanoseconds: 0 };
    // SAFETY: the structure has the layout of 64-bit Linux.
    unsafe { clock_gettime(THREAD, &mut t) };
    t.seconds as f64 + 1e-9 * t.nanoseconds as f64
}

/// The part of `n` things that is thread `i`'s, of `threads`.
fn part<T>(all: &[T], i: usize, threads: usize) -> &[T] {
    &all[all.len() * i / threads..all.len() * (i + 1) / threads]
}

fn each<'a, T: Sync>(all: &'a [T], f: impl Fn(&'a T) -> usize + Sync + 'a) -> Run<'a> {
    Box::new(move |i, threads| part(all, i, threads).iter().map(|x| black_box(f(x))).sum())
}

/// All rows for a scene.
pub fn rows<'a>(ours: &'a Accel, fast: &'a Embree, robust: &'a Embree, rays: &'a Rays) -> Vec<Row<'a>> {
    let mut rows = Vec::new();
    for (closest, any, eights, coherent) in
        [("primary, closest", "primary, any", &rays.primary, true), ("bounce, closest", "bounce, any", &rays.bounce, false)]
    {
        let n_rays = 8 * eights.len();
        let hit = |primitive: u32| usize::from(primitive != u32::MAX);
        let closest_of = |e: &'a Embree| each(eights, move |r| r.iter().map(|r| hit(e.closest(r).primitive)).sum());
        let closest8_of = |e: &'a Embree| each(eights, move |r| e.closest8(r, coherent).primitive.iter().map(|&p| hit(p)).sum());
        let any_of = |e: &'a Embree| each(eights, move |r| r.iter().filter(|r| e.occluded(r)).count());
        let any8_of = |e: &'a Embree| each(eights, move |r| e.occluded8(r, coherent).count_ones() as usize);
        let columns = vec![
            Column { name: "embree 1", run: closest_of(fast) },
            Column { name: "robust 1", run: closest_of(robust) },
            Column { name: "radiosa 1", run: each(eights, |r| r.iter().filter(|r| ours.closest(r).is_some()).count()) },
            Column { name: "embree 8", run: closest8_of(fast) },
            Column { name: "robust 8", run: closest8_of(robust) },
            Column { name: "radiosa 8", run: each(eights, |r| ours.closest8(r, 0xFF).iter().flatten().count()) },
        ];
        rows.push(Row { name: closest, n_rays, columns });
        let columns = vec![
            Column { name: "embree 1", run: any_of(fast) },
            Column { name: "robust 1", run: any_of(robust) },
            Column { name: "radiosa 1", run: each(eights, |r| r.iter().filter(|r| ours.occluded(r)).count()) },
            Column { name: "embree 8", run: any8_of(fast) },
            Column { name: "robust 8", run: any8_of(robust) },
            Column { name: "radiosa 8", run: each(eights, |r| ours.occluded8(r, 0xFF).count_ones() as usize) },
        ];
        rows.push(Row { name: any, n_rays, columns });
    }
    let pairs = &rays.segments;
    let eights = |r: &[Ray; 64], f: &dyn Fn(&[Ray; 8]) -> u8| -> usize {
        r.chunks_exact(8).map(|c| f(c.try_into().expect("eight")).count_ones() as usize).sum()
    };
    let pair = |i: usize, threads: usize| {
        let (mut occluder, mut blocked) = (Occluder::default(), Vec::new());
        let mut n = 0;
        for pair in part(pairs, i, threads) {
            ours.occluded_between(pair, &mut occluder, &mut blocked);
            n += black_box(&blocked).iter().filter(|b| **b).count();
        }
        n
    };
    let columns = vec![
        Column { name: "embree 1", run: each(pairs, |r| r.iter().filter(|r| fast.occluded(r)).count()) },
        Column { name: "robust 1", run: each(pairs, |r| r.iter().filter(|r| robust.occluded(r)).count()) },
        Column { name: "radiosa 1", run: each(pairs, |r| r.iter().filter(|r| ours.occluded(r)).count()) },
        Column { name: "embree 8", run: each(pairs, move |r| eights(r, &|r| fast.occluded8(r, true))) },
        Column { name: "robust 8", run: each(pairs, move |r| eights(r, &|r| robust.occluded8(r, true))) },
        Column { name: "radiosa 8", run: each(pairs, move |r| eights(r, &|r| ours.occluded8(r, 0xFF))) },
        Column { name: "radiosa pair", run: Box::new(pair) },
    ];
    rows.push(Row { name: "segments, any", n_rays: 64 * pairs.len(), columns });
    rows
}

/// Million rays a second and thread for each column, medians; ratios to the first, medians of ratios of the same turn; hits.
pub fn measure(row: &Row<'_>, threads: usize, turns: usize) -> String {
    let mut rates = vec![Vec::new(); row.columns.len()];
    let mut hits = vec![0; row.columns.len()];
    for _ in 0..turns {
        for (c, column) in row.columns.iter().enumerate() {
            let results: Vec<(usize, f64)> = std::thread::scope(|scope| {
                let run = |i| {
                    let start = cpu_time();
                    let n = (column.run)(i, threads);
                    (n, cpu_time() - start)
                };
                let workers: Vec<_> = (0..threads).map(|i| scope.spawn(move || run(i))).collect();
                workers.into_iter().map(|w| w.join().expect("no panic")).collect()
            });
            hits[c] = results.iter().map(|r| r.0).sum();
            let seconds: f64 = results.iter().map(|r| r.1).sum();
            rates[c].push(1e-6 * row.n_rays as f64 / seconds);
        }
    }
    let mut line = format!("  {:<18}", row.name);
    let ratio = |a: usize, b: usize| median(rates[a].iter().zip(&rates[b]).map(|(a, b)| a / b).collect());
    for (c, column) in row.columns.iter().enumerate() {
        let _ = write!(line, " {} {:6.2}", column.name, median(rates[c].clone()));
        // Ours beside Embree's of the same kind, fast and robust; the pair form beside single rays.
        match c {
            2 | 5 => write!(line, " ({:.2} / {:.2})", ratio(c, c - 2), ratio(c, c - 1)),
            6 => write!(line, " ({:.2} / {:.2})", ratio(c, 0), ratio(c, 1)),
            _ => Ok(()),
        }
        .expect("writing to a string");
    }
    let same = hits.iter().all(|h| *h == hits[0]);
    let _ = if same { write!(line, "  hits {}", hits[0]) } else { write!(line, "  hits {hits:?}") };
    line
}

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}
