//! Against the arithmetic of the processor that runs the tests. The routines in assembly are tested on emulated cores
//! (`cargo test -p motion-tests --test target`), with the same operands.

extern crate std;

use std::println;

use crate::any;
use crate::operands::Operands;

const PAIRS: usize = 3_000_000;

fn is_same(found: u64, expected: f64) -> bool {
    if expected.is_nan() { f64::from_bits(found).is_nan() } else { found == expected.to_bits() }
}

#[test]
fn results_are_those_of_the_processor() {
    let mut kinds = [0; 3];
    for (number, (a, b)) in Operands::new(1).take(PAIRS).enumerate() {
        let (x, y) = (f64::from_bits(a), f64::from_bits(b));
        for (found, expected) in
            [(any::sum(a, b), x + y), (any::product(a, b), x * y), (any::quotient(a, b), x / y)]
        {
            assert!(
                is_same(found, expected),
                "pair {number}, {x:e} and {y:e}: {expected:e}, found {found:#x}"
            );
            kinds[0] += usize::from(expected.is_normal());
            kinds[1] += usize::from(expected.is_subnormal());
            kinds[2] += usize::from(expected.is_infinite());
        }
        for (found, expected) in [
            (any::is_less(a, b), x < y),
            (any::is_greater(a, b), x > y),
            (any::is_not_greater(a, b), x <= y),
            (any::is_not_less(a, b), x >= y),
            (any::is_equal(a, b), x == y),
            (any::is_unordered(a, b), x.is_nan() || y.is_nan()),
        ] {
            assert_eq!(found, u32::from(expected), "pair {number}, {x:e} and {y:e}");
        }
    }
    println!("normal, subnormal, infinite: {kinds:?}");
    assert!(kinds.iter().all(|&kind| kind > PAIRS / 20), "{kinds:?}");
}
