//! What compiled programs take: bytes for each line block and each curved block, by kind of item.
//!
//! ```text
//! cargo bench -p motion-tests --bench bytes [-- FILE...]
//! ```
use motion_host::compare::{Path, on};
use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Item as PlanItem, Mode, plan_program};
use motion_host::toolpath::Element;
use motion_kernel::program::Item;
use motion_kernel::program::compact::{Decoder, Encoder};
use motion_tests::bench;
use motion_tests::samples::SAMPLES;

fn main() {
    let Some(files) = bench::asked() else { return };
    let machine = Machine::reference();
    let mut totals = [(0, 0); 4];
    let dump = std::env::var("DUMP").is_ok();
    for (name, text) in SAMPLES {
        for path in [Path::Exact, Path::Blended(0.01), Path::Blended(0.05)] {
            let program = gcode::read(name, text.as_bytes()).unwrap();
            let plan = plan_program(name, &on(&program, path), &machine, Mode::Spanning).unwrap();
            let (mut lines, mut curves) = (0, 0);
            for item in &plan.items { if let PlanItem::Stretch(s) = item { for b in &s.blocks { if matches!(b.element, Element::Line { .. }) { lines += 1 } else { curves += 1 } } } }
            let ex = Executable::new::<f32>(&plan).unwrap();
            let mut c = [[(0usize, 0usize); 5]; 2];
            let mut kind = 0;
            let mut pend = vec![];
            let mut encoder = Encoder::<3>::new();
            let mut decoder = Decoder::<3>::new();
            for item in &ex.items {
                let mut v = [0; 1000];
                let n = encoder.encode(item, &mut v).unwrap();
                let back = decoder.take(&v[..n]).unwrap();
                assert!(back.0 == *item && back.1.is_empty(), "{item:?} {back:?}");
                if dump { println!("{n} {item:?}"); }
                match item {
                    Item::Block(_) => pend.push(n),
                    Item::Line {..} | Item::Septic {..} => {
                        kind = usize::from(matches!(item, Item::Septic {..}));
                        for n in pend.drain(..) { c[kind][1].0 += 1; c[kind][1].1 += n; }
                        c[kind][0].0 += 1; c[kind][0].1 += n;
                    }
                    Item::Feed(r) if r.ramp.is_cruise() => { c[kind][2].0 += 1; c[kind][2].1 += n; }
                    Item::Feed(_) => { c[kind][3].0 += 1; c[kind][3].1 += n; }
                    _ => { c[kind][4].0 += 1; c[kind][4].1 += n; }
                }
            }
            for (k, n) in [("line", lines), ("curve", curves)] {
                let c = c[usize::from(k == "curve")];
                let total: usize = c.iter().map(|x| x.1).sum();
                let t = usize::from(k == "curve") + if name == "modes" { 2 } else { 0 }; totals[t].0 += total; totals[t].1 += n;
                println!("{name:12} {path:16} {k:6} blocks {n:6} total/block {:7.1} | piece {:?} block {:?} cruise {:?} ramp {:?} other {:?}", total as f64 / f64::from(n), c[0], c[1], c[2], c[3], c[4]);
            }
        }
    }
    println!("{totals:?} {:?}", totals.map(|(b, n)| b as f64 / n as f64));
    let _ = files;
}
