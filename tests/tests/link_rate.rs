//! What a serial line carries, by count of bytes: straight blocks with everything that belongs to them, and telemetry.

use std::collections::VecDeque;
use std::fmt::Write;

use motion_host::gcode;
use motion_host::machine::Machine;
use motion_host::planning::{Executable, Mode as PlanMode, plan_program};
use motion_kernel::link::{BoardLink, Event, FRAME_MAX, HostLink, Identity, ItemQueue, State, Status};
use motion_kernel::program::{Item, Source};
use motion_kernel::units::Position;
use motion_tests::link::{IDENTITY, STATUS};
use motion_tests::random::Random;

/// As the emulated boards have it.
const ROOM: usize = 256;
/// 921 600 baud, ten bits a byte \[bytes/ms\].
const BYTES_PER_MS: f64 = 92.16;
/// An answer takes this time to the PC: the polls of a USB adapter \[ms\].
const ANSWER_MS: usize = 2;
/// A status comes this often \[ms\].
const STATUS_MS: u32 = 20;
/// A scope at 2 kHz sends this much in this time (`scoped` in `boards/common`: 5.5 bytes a tick) \[bytes, ms\].
const SCOPE: (usize, u32) = (220, 20);
const BLOCKS: usize = 6000;
/// Straight blocks that are promised \[1/s\].
const LEAST_PER_S: f64 = 1000.0;

/// A direction of the line: what is written goes out as fast as the line takes it, and is there some time later.
struct Line {
    waiting: VecDeque<u8>,
    credit: f64,
    under_way: VecDeque<Vec<u8>>,
    carried: usize,
}

impl Line {
    fn new(delay_ms: usize) -> Self {
        let under_way = vec![Vec::new(); delay_ms].into();
        Self { waiting: VecDeque::new(), credit: 0.0, under_way, carried: 0 }
    }

    /// A millisecond: what arrives in it.
    fn turn(&mut self) -> Vec<u8> {
        self.credit = (self.credit + BYTES_PER_MS).min(2.0 * BYTES_PER_MS);
        let count = (self.credit as usize).min(self.waiting.len());
        self.credit -= count as f64;
        self.carried += count;
        self.under_way.push_back(self.waiting.drain(..count).collect());
        self.under_way.pop_front().unwrap_or_default()
    }
}

/// Lines of a twentieth of a millimetre, each in a direction of its own.
fn items() -> Vec<Item<3>> {
    let mut random = Random::of_stream(71);
    let mut text = "G21 G90 G61 F3000\n".to_owned();
    let (mut x, mut y) = (0.0, 0.0);
    for _ in 0..BLOCKS {
        (x, y) = (x + random.between(0.03, 0.06), y + random.between(-0.004, 0.004));
        writeln!(text, "G1 X{x:.4} Y{y:.4}").expect("room");
    }
    let program = gcode::read("dense", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let plan = plan_program("dense", &program, &Machine::reference(), PlanMode::Spanning)
        .unwrap_or_else(|error| panic!("{error}"));
    Executable::new::<f32>(&plan).unwrap_or_else(|error| panic!("{error}")).items
}

/// A board that takes whatever comes. Its line back carries statuses and a scope.
#[test]
fn a_thousand_blocks_a_second_pass_a_serial_line() {
    let items = items();
    let blocks = items.iter().filter(|item| matches!(item, Item::Line { .. })).count();
    assert_eq!(blocks, BLOCKS);
    let identity = Identity { items: ROOM as u16, ..IDENTITY };
    let mut host: Box<HostLink<3, 256, 65536>> = Box::new(HostLink::new(1));
    let (mut board, mut queue) = (BoardLink::new(1, identity), ItemQueue::<3, ROOM>::new());
    let (mut down, mut up) = (Line::new(0), Line::new(ANSWER_MS));
    let (mut pushed, mut taken, mut now_ms, mut statuses) = (0, 0, 0_u32, 0_u32);
    let mut out = [0; FRAME_MAX];
    while taken < items.len() {
        now_ms += 1;
        assert!(now_ms < 60_000, "{taken} of {} items", items.len());
        while let Some(item) = items.get(pushed)
            && host.push(Some(item)).expect("short")
        {
            pushed += 1;
        }
        // As a system's driver does, a little ahead of the line.
        while down.waiting.len() < BYTES_PER_MS as usize {
            let length = host.transmit(now_ms, &mut out);
            if length == 0 {
                break;
            }
            down.waiting.extend(&out[..length]);
        }
        let mut bytes = down.turn().into_iter();
        while bytes.len() > 0 {
            board.receive(&mut bytes);
            board.put_items(&mut queue);
        }
        while let std::task::Poll::Ready(Some(Ok(item))) = queue.poll_next() {
            assert_eq!(item, items[taken], "item {taken}");
            taken += 1;
        }
        let (bytes, period_ms) = SCOPE;
        if now_ms.is_multiple_of(period_ms) {
            let length = board.transmit_scope((1, now_ms), &vec![0x55; bytes], &mut out);
            up.waiting.extend(&out[..length]);
        }
        let status = now_ms.is_multiple_of(STATUS_MS).then(|| status(now_ms, taken as u32));
        let length = board.transmit(now_ms, &queue, status, &mut out);
        up.waiting.extend(&out[..length]);
        let bytes = up.turn();
        host.receive(&bytes, now_ms, &mut |event| statuses += u32::from(matches!(event, Event::Status(_))));
    }
    let s = f64::from(now_ms) * 1e-3;
    let per_s = blocks as f64 / s;
    println!(
        "{per_s:.0} straight blocks a second: {:.0} bytes/s to the board, {:.0} back with {:.0} statuses a second; {:.1} bytes \
         a block",
        down.carried as f64 / s,
        up.carried as f64 / s,
        f64::from(statuses) / s,
        down.carried as f64 / blocks as f64,
    );
    assert!(per_s >= LEAST_PER_S, "{per_s} blocks a second");
}

fn status(tick: u32, taken: u32) -> Status<3> {
    let position = Position::from_bits(i64::from(tick) << 30);
    Status {
        tick,
        state: State::Moving,
        set: [position; 3],
        actual: [position; 3],
        feed_mm_s: 50.0,
        line: taken,
        taken,
        driven: taken,
        ..STATUS
    }
}
