use super::*;

/// A caller at 0x100, the function at 0x200 with a loop of two rounds, a leaf at 0x300.
const CODE: &str = "\
----------------
IN: main
0x00000100:  f000 f87e  bl       #0x200

----------------
IN: main
0x00000104:  e7fc       b        #0x100

----------------
IN: budgeted_tick
0x00000200:  b510       push     {r4, lr}

----------------
IN: budgeted_tick
0x00000202:  f000 f87d  bl       #0x300

----------------
IN: budgeted_tick
0x00000206:  3c01       subs     r4, #1

----------------
IN: budgeted_tick
0x00000208:  d1fb       bne      #0x202

----------------
IN: budgeted_tick
0x0000020a:  bd10       pop      {r4, pc}

----------------
IN: leaf
0x00000300:  ee20 0a20  vmul.f32 s0, s0, s1

----------------
IN: leaf
0x00000304:  4770       bx       lr

";

/// One call: push 3, then twice bl 3..4, vmul 1, bx 3..4, subs 1, bne taken 3..4 and then not 1, pop 6.
const ONE_CALL: [u32; 13] =
    [0x100, 0x200, 0x202, 0x300, 0x304, 0x206, 0x208, 0x202, 0x300, 0x304, 0x206, 0x208, 0x20a];
///
/// Lines 0x200, then 0x300 by a jump, both kept from then on.
const ESTIMATE: Estimate = Estimate {
    instructions: 12,
    nominal_cycles: 29,
    pessimistic_cycles: 34,
    nominal_waits: 5 + 5,
    pessimistic_waits: 10 + 10,
};

fn executed(addresses: impl IntoIterator<Item = u32>) -> String {
    let line = |at| format!("Trace 0: 0x7ff3f8000100 [00800408/{at:08x}/00000110/ff000201] name\n");
    addresses.into_iter().map(line).collect()
}

fn read(log: &str, begin: Begin) -> Vec<Result<Estimate, String>> {
    Calls::new(log.as_bytes(), begin).map(|item| item.map_err(|error| error.to_string())).collect()
}

fn tick() -> Begin {
    Begin::Address(0x201)
}

#[test]
fn each_call_is_one_estimate() {
    let log = CODE.to_owned() + &executed([ONE_CALL.as_slice(), &[0x104], &ONE_CALL, &[0x104]].concat());
    assert_eq!(read(&log, tick()), [Ok(ESTIMATE), Ok(ESTIMATE)]);
    assert_eq!(read(&log, Begin::Symbol("budgeted_tick".to_owned())), [Ok(ESTIMATE), Ok(ESTIMATE)]);
    assert_eq!(read(&log, Begin::Symbol("other".to_owned())), []);
}

#[test]
fn an_execution_taken_back_is_not_counted() {
    let mut log = CODE.to_owned() + &executed(ONE_CALL);
    log += "Stopped execution of TB chain before 0x7ff3f8000100 [0000020a] name\n";
    log += &executed([0x20a, 0x104]);
    assert_eq!(read(&log, tick()), [Ok(ESTIMATE)]);
}

#[test]
fn an_exception_within_a_call_is_an_error() {
    let log = CODE.to_owned() + &executed([0x100, 0x200, 0x202, 0x300, 0x100]);
    assert_eq!(read(&log, tick()), [Err("an exception was taken after 0x00000300".to_owned())]);
}

#[test]
fn an_instruction_without_price_is_an_error_only_where_it_counts() {
    let mut log = "0x00000400:  beab       bkpt     #0xab\n".to_owned() + CODE + &executed([0x400]);
    log += &executed(ONE_CALL);
    assert_eq!(read(&(log.clone() + &executed([0x104])), tick()), [Ok(ESTIMATE)]);
    log = log.replace("subs     r4, #1", "svc      #1");
    assert_eq!(
        read(&log, tick()),
        [Err("0x00000206: no price for the instruction `svc      #1`".to_owned())]
    );
}

#[test]
fn what_cannot_be_followed_is_an_error() {
    for (log, error) in [
        (executed([0x100, 0x200]), "0x00000100 ran but was not disassembled"),
        (
            CODE.to_owned() + &executed([0x104, 0x200]),
            "the function was reached from 0x00000104 without a call",
        ),
        (CODE.to_owned() + &executed([0x100, 0x200, 0x202]), "the trace ends within a call"),
        ("Trace 0: 0x7ff3\n".to_owned(), "not a line of a trace: `Trace 0: 0x7ff3`"),
        ("OBJD-T: 80b5\n".to_owned(), "not a line of a trace: `OBJD-T: 80b5`"),
    ] {
        assert_eq!(read(&log, tick()), [Err(error.to_owned())]);
    }
}
