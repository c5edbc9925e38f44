//! Counts the instructions of the law's shapes by every backend that this core's number type has, over the
//! span of a phase.
#![no_std]
#![no_main]

use core::hint::black_box;

use motion_kernel::internals::{Own, Shape, SineCosine};
use motion_kernel::num::{Real, Scalar};
use qemu_boards::count::Counter;
use qemu_boards::processor::{Timer, entry};
use qemu_boards::{Number, exit, fail, println};

type Unit = <Number as Real>::Unit;

#[entry]
fn main() -> ! {
    let mut timer = Timer::take().unwrap_or_else(|| fail(&"timer"));
    let counter = Counter::new(&mut timer);
    shape(&counter, "series", Shape::at);
    shape(&counter, "closed, own", Shape::closed::<Own>);
    sine(&counter, "sine, own", <Own as SineCosine<Unit>>::sin_cos);
    #[cfg(any(target_abi = "eabihf", feature = "soft-float"))]
    {
        use motion_kernel::internals::{Libm, Micromath};
        shape(&counter, "closed, libm", Shape::closed::<Libm>);
        shape(&counter, "closed, micromath", Shape::closed::<Micromath>);
        sine(&counter, "sine, libm", <Libm as SineCosine<Unit>>::sin_cos);
        sine(&counter, "sine, micromath", <Micromath as SineCosine<Unit>>::sin_cos);
    }
    exit(true)
}

/// Times of a phase: more than its two halves and the octants of a sine.
const POINTS: u32 = 64;

fn shape(counter: &Counter, name: &str, shape: fn(Unit) -> Shape<Unit>) {
    for point in 0..=POINTS {
        let x = Unit::from_f64(f64::from(point) / f64::from(POINTS));
        let (shape, x) = black_box((shape, x));
        let (_, spent) = counter.count(|| shape(x));
        println!("{} {}", name, spent);
    }
}

fn sine(counter: &Counter, name: &str, sine: fn(Unit) -> (Unit, Unit)) {
    for point in 0..=POINTS {
        let x = Unit::from_f64(0.5 * f64::from(point) / f64::from(POINTS));
        let (sine, x) = black_box((sine, x));
        let (_, spent) = counter.count(|| sine(x));
        println!("{} {}", name, spent);
    }
}
