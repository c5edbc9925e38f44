//! What boards carry in their folders is what the tools make now.

use std::path::Path;

use motion_host::machine::Machine;
use motion_host::planning::Executable;
use motion_tests::check::planned;

const STRINGER: &str = "../boards/common/program/stringer.bin";

#[test]
fn the_flashed_stringer_is_what_compile_writes() {
    let machine = Machine::reference();
    let plan = planned(include_str!("../../host/src/cli/stringer.ngc"), &machine).expect("a plan");
    let made = Executable::new::<f32>(&plan).expect("executable").to_live_bytes(&machine);
    let found = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(STRINGER)).expect("a file");
    assert!(
        made == found,
        "cargo run --release -- compile host/src/cli/stringer.ngc --live -o boards/common/program/stringer.bin"
    );
}
