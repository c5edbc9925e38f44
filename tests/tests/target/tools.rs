//! Emulator and compiler; images are built once, when they are first asked for.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};

use motion_tests::figures::is_accepting;

/// A core to run on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Board {
    /// As people call it.
    pub(crate) core: &'static str,
    /// QEMU's machine.
    machine: &'static str,
    pub(crate) target: &'static str,
    pub(crate) number: &'static str,
    /// Where its programs lie (`boards/qemu-mps2/src/programs.rs`), and how much fits there.
    address: usize,
    pub(crate) room: usize,
    features: &'static str,
}

const MIB: usize = 1 << 20;
const KIB: usize = 1 << 10;

pub(crate) const M4F: Board = Board {
    core: "Cortex-M4F",
    machine: "mps2-an386",
    target: "thumbv7em-none-eabihf",
    number: "f32",
    address: 2 * MIB,
    room: 2 * MIB,
    features: "",
};
pub(crate) const M7: Board = Board { core: "Cortex-M7", machine: "mps2-an500", ..M4F };
pub(crate) const M3: Board =
    Board { core: "Cortex-M3", machine: "mps2-an385", target: "thumbv7m-none-eabi", number: "fixed", ..M4F };
pub(crate) const M3_SOFT: Board = Board { number: "f32 in software", features: "soft-float", ..M3 };
pub(crate) const M0: Board = Board {
    core: "Cortex-M0",
    machine: "microbit",
    target: "thumbv6m-none-eabi",
    number: "fixed",
    address: 192 * KIB,
    room: 64 * KIB,
    features: "",
};
pub(crate) const RISC_V: Board = Board {
    core: "RISC-V RV32IMAFC",
    machine: "virt",
    target: "riscv32imafc-unknown-none-elf",
    address: 0x8040_0000,
    ..M4F
};
/// Every core with the number type that is meant for it.
pub(crate) const BOARDS: [Board; 5] = [M4F, M7, M3, M0, RISC_V];

/// The cores with room for live control.
const LARGE: [Board; 4] = [M4F, M7, M3, RISC_V];
/// Those with it.
pub(crate) const LIVE_BOARDS: [Board; 4] = all_with("live");
/// The same with ticks that stop the background, which says where.
pub(crate) const WATCHED_BOARDS: [Board; 4] = all_with("watch");

/// Those that run as a board on the link: the UART is that of the MPS2.
pub(crate) const LINKED_BOARDS: [Board; 2] = [M4F.with("link"), M3.with("link")];

/// The one whose axes are compensated.
pub(crate) const COMPENSATED: Board = M4F.with("compensation");

const fn all_with(features: &'static str) -> [Board; 4] {
    let [m4f, m7, m3, risc_v] = LARGE;
    [m4f.with(features), m7.with(features), m3.with(features), risc_v.with(features)]
}

impl Board {
    /// The same core with images of other features.
    pub(crate) const fn with(self, features: &'static str) -> Self {
        Self { features, ..self }
    }

    fn is_arm(self) -> bool {
        self.target.starts_with("thumb")
    }

    /// As tables of counts call it: an M4F and an M7 execute the same instructions of the same images
    /// ([`Tools::count`]).
    pub(crate) fn cores(self) -> &'static str {
        if self.core == M4F.core { "Cortex-M4F, M7" } else { self.core }
    }
}

/// How instructions become time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clock {
    /// As fast as it goes.
    Free,
    /// By the number of instructions, so that a timer counts them.
    Counting,
}

/// After which an emulator is ended, on machines however slow \[s\]. It stays in the group of its test's process, so what ends that ends
/// it, too.
pub(crate) const HANGS_AFTER_S: &str = "1800";

/// For ARM and for RISC-V.
const EMULATORS: [&str; 2] = ["qemu-system-arm", "qemu-system-riscv32"];

/// What makes the emulator count: 64 ns of its time for every instruction.
pub(crate) const COUNTING: [&str; 2] = ["-icount", "shift=6,sleep=off"];

/// The images that tests ask for, by features.
const IMAGES: [(&str, &[&str]); 6] = [
    ("", &["closed_loop", "interrupt", "budget", "functions", "runtime", "kernel_only", "empty"]),
    ("live", &["live", "live_budget", "answers", "budget", "kernel_only", "empty"]),
    ("compensation", &["live_budget"]),
    ("watch", &["live_interrupt"]),
    ("link", &["linked", "empty"]),
    ("soft-float", &["budget", "functions"]),
];

/// A program, and the seed of the commands that it gets under live control.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Case {
    pub(crate) seed: u32,
    pub(crate) bytes: Vec<u8>,
}

/// Programs with their places as seeds.
pub(crate) fn by_place(programs: &[Vec<u8>]) -> Vec<Case> {
    (0..).zip(programs).map(|(seed, bytes)| Case { seed, bytes: bytes.clone() }).collect()
}

/// Cases in bundles that fit the board.
pub(crate) fn bundles(board: Board, cases: &[Case]) -> Vec<Vec<Case>> {
    let mut bundles = vec![Vec::new()];
    let mut room = board.room - 4;
    for case in cases {
        let needed = case.bytes.len().next_multiple_of(4) + 8;
        if needed > room {
            bundles.push(Vec::new());
            room = board.room - 4;
        }
        room -= needed;
        bundles.last_mut().expect("one at least").push(case.clone());
    }
    bundles
}

/// Machine, image, programs.
type Run = (&'static str, PathBuf, Vec<Case>);
/// What it printed; empty while the first one who asks runs it.
type Printed = Arc<Mutex<Option<String>>>;

/// The tools of this machine.
pub(crate) struct Tools {
    compiler: Compiler,
    /// Folders of built images, by features.
    built: Mutex<BTreeMap<&'static str, PathBuf>>,
    /// Where instructions are counted, the same run prints the same.
    counted: Mutex<BTreeMap<Run, Printed>>,
}

struct Compiler {
    rustc: PathBuf,
    /// It lacks the library for the target, and has its source.
    builds_core: bool,
    version: String,
}

fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

impl Tools {
    /// What this machine has, or what is missing.
    pub(crate) fn find() -> Result<Self, String> {
        for emulator in EMULATORS {
            if output(Command::new(emulator).arg("--version")).is_none() {
                return Err(format!("needs {emulator}"));
            }
        }
        let compiler = Compiler::with_source().or_else(Compiler::with_targets).ok_or(
            "needs a compiler for Cortex-M and RISC-V: Debian's rustc-web and rust-web-src, or rustup target add \
             thumbv7em-none-eabihf thumbv7m-none-eabi thumbv6m-none-eabi riscv32imafc-unknown-none-elf",
        )?;
        Ok(Self { compiler, built: Mutex::default(), counted: Mutex::default() })
    }

    /// Why figures measured here can't be compared with the committed ones.
    pub(crate) fn other_compiler(&self) -> Option<String> {
        if is_accepting() {
            return None;
        }
        let committed = std::fs::read_to_string(root().join("tests/expected/compiler.txt")).ok()?;
        let (committed, found) = (committed.trim(), &self.compiler.version);
        (committed != found).then(|| format!("figures are those of {committed}, here is {found}"))
    }

    /// Notes the compiler of figures that are being accepted.
    pub(crate) fn accept_compiler(&self) -> Result<(), String> {
        if !is_accepting() {
            return Ok(());
        }
        let path = root().join("tests/expected/compiler.txt");
        std::fs::write(&path, format!("{}\n", self.compiler.version)).map_err(|error| error.to_string())
    }

    /// The image `name` for a board.
    pub(crate) fn image(&self, board: Board, name: &str) -> Result<PathBuf, String> {
        // One build at a time: others would wait for cargo's lock anyway.
        let mut built = self.built.lock().map_err(|_| "a build panicked".to_owned())?;
        if !built.contains_key(board.features) {
            let folder = self.build(board.features)?;
            built.insert(board.features, folder);
        }
        Ok(built[board.features].join(board.target).join(name))
    }

    /// All images with `features`, for all targets, in a folder by target.
    fn build(&self, features: &'static str) -> Result<PathBuf, String> {
        let boards = BOARDS.into_iter().chain(LIVE_BOARDS).chain(WATCHED_BOARDS);
        let boards = boards.chain(LINKED_BOARDS).chain([M3_SOFT, COMPENSATED]);
        let targets: BTreeSet<_> =
            boards.filter(|board| board.features == features).map(|board| board.target).collect();
        let images = IMAGES.iter().find(|(of, _)| *of == features).map_or(&[][..], |(_, images)| *images);
        // One folder for all, so that the libraries are built once for a target.
        let target_dir = root().join("target/boards");
        // Apart: cargo would give a crate that both have the features of both.
        let (arm, other): (Vec<_>, Vec<_>) = targets.iter().partition(|target| target.starts_with("thumb"));
        for targets in [arm, other].into_iter().filter(|targets| !targets.is_empty()) {
            self.build_for(&targets, features, images, &target_dir)?;
        }
        // Away from where those with other features would replace them.
        let folder = target_dir.join("images").join(if features.is_empty() { "plain" } else { features });
        for target in targets {
            let (from, to) = (target_dir.join(target).join("release"), folder.join(target));
            std::fs::create_dir_all(&to).map_err(|error| format!("{}: {error}", to.display()))?;
            for image in images {
                std::fs::copy(from.join(image), to.join(image))
                    .map_err(|error| format!("{image}: {error}"))?;
            }
        }
        Ok(folder)
    }

    /// All of `images` for `targets`.
    fn build_for(
        &self,
        targets: &[&str],
        features: &str,
        images: &[&str],
        target_dir: &Path,
    ) -> Result<(), String> {
        let mut cargo = self.cargo("boards/qemu-mps2")?;
        cargo
            .args(["--features", features])
            .args(targets.iter().flat_map(|target| ["--target", *target]))
            .args(images.iter().flat_map(|image| ["--bin", *image]))
            .arg("--target-dir")
            .arg(target_dir);
        let done = cargo.output().map_err(|error| format!("cargo: {error}"))?;
        if !done.status.success() {
            return Err(format!("build for {targets:?}: {}", String::from_utf8_lossy(&done.stderr)));
        }
        Ok(())
    }

    /// Cargo, about to build in a board's folder.
    fn cargo(&self, folder: &str) -> Result<Command, String> {
        let mut cargo = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()));
        // Not what the outer cargo was told.
        for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET", "CARGO_TARGET_DIR"] {
            cargo.env_remove(name);
        }
        cargo
            .current_dir(root().join(folder))
            .args(["build", "--release", "--locked"])
            .env("RUSTC", &self.compiler.rustc);
        if self.compiler.builds_core {
            let linker = linker().ok_or("the Rust toolchain has no rust-lld")?;
            cargo
                .arg("-Zbuild-std=core")
                .env("RUSTC_BOOTSTRAP", "1")
                .env("RUSTFLAGS", format!("-C linker={}", linker.display()));
        }
        Ok(cargo)
    }

    /// The firmware of the NUCLEO with `features`, among them that for the emulator.
    pub(crate) fn firmware(&self, features: &str) -> Result<PathBuf, String> {
        // One at a time: they leave their images in the same place.
        static BUILDS: Mutex<()> = Mutex::new(());
        let _build = BUILDS.lock().map_err(|_| "a build panicked".to_owned())?;
        // Where its plain build has compiled what both need.
        let mut cargo = self.cargo("boards/nucleo-f446re")?;
        // Its program is the one that the test knows.
        cargo.args(["--features", features, "--target", M4F.target]).env_remove("MOTION_PROGRAM");
        let done = cargo.output().map_err(|error| format!("cargo: {error}"))?;
        if !done.status.success() {
            return Err(format!("build of the firmware: {}", String::from_utf8_lossy(&done.stderr)));
        }
        let built = root().join("boards/nucleo-f446re/target").join(M4F.target).join("release/nucleo-f446re");
        // Away from where the plain build would replace it.
        let folder = root().join("target/boards/images/firmware");
        let image = folder.join(features);
        std::fs::create_dir_all(&folder)
            .and_then(|()| std::fs::copy(&built, &image))
            .map_err(|error| format!("{}: {error}", image.display()))?;
        Ok(image)
    }

    /// QEMU with an image and a bundle of programs, not yet started; its first serial port is `serial`.
    pub(crate) fn emulator(
        &self,
        board: Board,
        name: &str,
        bundle: &Path,
        serial: &str,
    ) -> Result<Command, String> {
        let mut command = Command::new("timeout");
        let emulator = if board.is_arm() { EMULATORS[0] } else { EMULATORS[1] };
        command
            .args(["--foreground", HANGS_AFTER_S])
            .args([emulator, "-M", board.machine, "-bios", "none", "-nographic"])
            .args(["-monitor", "none", "-serial", serial])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-device")
            .arg(format!("loader,file={},addr={:#x},force-raw=on", bundle.display(), board.address))
            .arg("-kernel")
            .arg(self.image(board, name)?);
        Ok(command)
    }

    /// Runs an image over `programs`, with their places as seeds; what it printed.
    pub(crate) fn run(
        &self,
        board: Board,
        name: &str,
        programs: &[Vec<u8>],
        clock: Clock,
    ) -> Result<String, String> {
        self.run_cases(board, name, &by_place(programs), clock)
    }

    /// Counts instructions: runs an image over `programs`, for an M4F on an M7 too, which must print the same.
    pub(crate) fn count(&self, board: Board, name: &str, programs: &[Vec<u8>]) -> Result<String, String> {
        let printed = self.run(board, name, programs, Clock::Counting)?;
        if board.core == M4F.core {
            let other = Board { machine: M7.machine, ..board };
            if self.run(other, name, programs, Clock::Counting)? != printed {
                return Err(format!("{name}: an M7 counts other instructions than an M4F"));
            }
        }
        Ok(printed)
    }

    /// Runs an image over `cases`; what it printed.
    pub(crate) fn run_cases(
        &self,
        board: Board,
        name: &str,
        cases: &[Case],
        clock: Clock,
    ) -> Result<String, String> {
        if clock == Clock::Free {
            return self.run_anew(board, name, cases, clock);
        }
        let key = (board.machine, self.image(board, name)?, cases.to_vec());
        let printed = Arc::clone(self.counted.lock().map_err(|_| "a run panicked")?.entry(key).or_default());
        let mut printed = printed.lock().map_err(|_| "a run panicked")?;
        if printed.is_none() {
            *printed = Some(self.run_anew(board, name, cases, clock)?);
        }
        Ok(printed.clone().unwrap_or_default())
    }

    /// The same, and nothing of it is kept.
    pub(crate) fn run_anew(
        &self,
        board: Board,
        name: &str,
        cases: &[Case],
        clock: Clock,
    ) -> Result<String, String> {
        let bundle = Bundle::new(cases)?;
        let mut command = self.emulator(board, name, bundle.path(), "none")?;
        if clock == Clock::Counting {
            command.args(COUNTING);
        }
        let done = command.output().map_err(|error| format!("emulator: {error}"))?;
        let printed = String::from_utf8_lossy(&done.stdout).into_owned();
        if done.status.success() {
            Ok(printed)
        } else {
            let errors = String::from_utf8_lossy(&done.stderr);
            let end: Vec<_> = printed.lines().rev().take(3).collect();
            Err(format!("{name} on {}: {}: {end:?} {errors}", board.core, done.status))
        }
    }
}

impl Compiler {
    /// One with the library's source, for targets that rustup can't add.
    fn with_source() -> Option<Self> {
        let rustc = PathBuf::from("/usr/bin/rustc");
        let sysroot = output(Command::new(&rustc).args(["--print", "sysroot"]))?;
        if !Path::new(&sysroot).join("lib/rustlib/src/rust/library/core/Cargo.toml").exists() {
            return None;
        }
        let version = output(Command::new(&rustc).arg("--version"))?;
        Some(Self { rustc, builds_core: true, version })
    }

    /// One with the targets' libraries.
    fn with_targets() -> Option<Self> {
        let rustc = PathBuf::from("rustc");
        let sysroot = output(Command::new(&rustc).args(["--print", "sysroot"]))?;
        let has = |board: &Board| Path::new(&sysroot).join("lib/rustlib").join(board.target).exists();
        if !BOARDS.iter().all(has) {
            return None;
        }
        let version = output(Command::new(&rustc).arg("--version"))?;
        Some(Self { rustc, builds_core: false, version })
    }
}

/// The linker that every rustup toolchain brings.
fn linker() -> Option<PathBuf> {
    let sysroot = output(Command::new("rustc").args(["--print", "sysroot"]))?;
    let host = output(Command::new("rustc").arg("-vV"))?;
    let host = host.lines().find_map(|line| line.strip_prefix("host: "))?.to_owned();
    let linker = Path::new(&sysroot).join("lib/rustlib").join(host).join("bin/rust-lld");
    linker.exists().then_some(linker)
}

/// Programs in a file of their own, removed with it.
pub(crate) struct Bundle(PathBuf);

impl Bundle {
    /// See `boards/qemu-mps2/src/programs.rs`.
    pub(crate) fn new(cases: &[Case]) -> Result<Self, String> {
        use std::sync::atomic::{AtomicU32, Ordering};
        static BUNDLES: AtomicU32 = AtomicU32::new(0);
        let mut bytes = u32::try_from(cases.len()).map_err(|error| error.to_string())?.to_le_bytes().to_vec();
        for Case { seed, bytes: program } in cases {
            let length = u32::try_from(program.len()).map_err(|error| error.to_string())?;
            bytes.extend(seed.to_le_bytes());
            bytes.extend(length.to_le_bytes());
            bytes.extend(program);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        let number = BUNDLES.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("motion-{}-{number}.bin", std::process::id()));
        std::fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(Self(path))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Bundle {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
