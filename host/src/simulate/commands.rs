//! What became of the commands of a run.
//!
//! Consumes a script and the executed ticks; produces a [`TracedCommand`] for each command that was given,
//! with the rest that it led to.

use super::live::{Command, Script, Timed};
use crate::trace::{TraceRow, TracedCommand, TracedStop};

/// Follows the ticks.
#[derive(Debug, Default)]
pub(super) struct Commands<'run> {
    ahead: &'run [Timed],
    records: Vec<TracedCommand>,
    /// Commands that wait for a rest, with their index in the records.
    waiting: Vec<(usize, Command)>,
    /// The rest under way: its first tick, and where.
    rest: Option<(u64, f64)>,
    /// Feed and path position at the end of the latest tick.
    latest: (f64, f64),
    tick_s: f64,
}

impl<'run> Commands<'run> {
    pub(super) fn new(script: Option<&'run Script>, tick_s: f64) -> Self {
        Self { ahead: script.map_or(&[], Script::commands), tick_s, ..Self::default() }
    }

    /// Takes a tick, before which so many commands were given in all.
    pub(super) fn add<const N: usize>(&mut self, given: usize, tick: &TraceRow<N>) {
        while let [next, ahead @ ..] = self.ahead
            && self.records.len() < given
        {
            self.ahead = ahead;
            self.give(tick.tick, next.command);
        }
        self.latest = (tick.v_mm_s, tick.s_mm);
        if tick.v_mm_s > 0.0 {
            self.rest = None;
        } else if self.rest.is_none() {
            self.rest = Some((tick.tick, tick.s_mm));
        }
    }

    fn give(&mut self, tick: u64, command: Command) {
        self.settle(|waiting| is_ended_by(waiting, command));
        if asks_for_rest(command) {
            self.waiting.push((self.records.len(), command));
        }
        let feed_override = match command {
            Command::Override(share) => Some(share),
            _ => None,
        };
        let (_, s_mm) = self.latest;
        self.records.push(TracedCommand {
            tick,
            command: command.to_string(),
            feed_override,
            s_mm,
            stop: None,
        });
    }

    /// Gives the rest under way, if there is one, to those that wait for one and do so no longer.
    fn settle(&mut self, is_ended: impl Fn(Command) -> bool) {
        let Self { rest, records, tick_s, .. } = self;
        self.waiting.retain(|&(index, command)| {
            let trace = &mut records[index];
            if is_ended(command)
                && let Some((tick, s_mm)) = *rest
            {
                // At rest before it was given: no time.
                let ticks = (tick + 1).saturating_sub(trace.tick);
                trace.stop = Some(TracedStop {
                    tick: tick.max(trace.tick),
                    time_s: ticks as f64 * *tick_s,
                    length_mm: (s_mm - trace.s_mm).max(0.0),
                });
            }
            !is_ended(command)
        });
    }

    /// Of all commands that were given, and the others as the user gave them.
    pub(super) fn finish(mut self) -> (Vec<TracedCommand>, Vec<String>) {
        self.settle(|_| true);
        (self.records, self.ahead.iter().map(Timed::to_string).collect())
    }
}

fn asks_for_rest(command: Command) -> bool {
    match command {
        Command::Hold | Command::Abort => true,
        Command::Override(share) => share <= 0.0,
        Command::SingleBlock(is_single) => is_single,
        Command::Resume => false,
    }
}

/// Whether `command` is what the rest that `waiting` asked for ends with.
fn is_ended_by(waiting: Command, command: Command) -> bool {
    match (waiting, command) {
        (Command::Hold | Command::SingleBlock(_), Command::Resume) => true,
        (Command::SingleBlock(true), Command::SingleBlock(false)) => true,
        (Command::Override(_), Command::Override(share)) => share > 0.0,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::RunInfo;
    use crate::trace::AxisTick;

    /// Ticks of 1 ms with these feeds; the path grows by a hundredth of the feed.
    fn records(script: &str, feeds_mm_s: &[f64]) -> Vec<TracedCommand> {
        let script: Script = script.parse().expect("a script");
        let info = RunInfo { tick_s: 1e-3, ..RunInfo::default() };
        let due = script.due(&info);
        let mut commands = Commands::new(Some(&script), info.tick_s);
        let mut s_mm = 0.0;
        for (tick, &v_mm_s) in feeds_mm_s.iter().enumerate() {
            s_mm += 0.01 * v_mm_s;
            let given = due.iter().filter(|due| due.is_reached(tick as u64, 0.0)).count();
            let row = TraceRow {
                tick: tick as u64,
                s_mm,
                v_mm_s,
                a_mm_s2: 0.0,
                j_mm_s3: 0.0,
                snap_mm_s4: 0.0,
                state: "moving",
                line: 0,
                contour_um: 0.0,
                axes: [AxisTick::default(); 3],
            };
            commands.add(given, &row);
        }
        commands.finish().0
    }

    fn stops(records: &[TracedCommand]) -> Vec<Option<(u64, u32, f64)>> {
        let stop = |stop: &TracedStop| {
            (stop.tick, (stop.time_s * 1e3).round() as u32, (stop.length_mm * 1e6).round() / 1e6)
        };
        records.iter().map(|trace| trace.stop.as_ref().map(stop)).collect()
    }

    #[test]
    fn a_hold_is_answered_by_the_rest_before_its_resume() {
        let found = records("2:hold,6:resume", &[10.0, 10.0, 10.0, 5.0, 0.0, 0.0, 5.0, 10.0]);
        assert_eq!(stops(&found), [Some((4, 3, 0.15)), None]);
        assert!((found[0].s_mm - 0.2).abs() < 1e-12);
        // Resumed on the way: no rest, not even a later one.
        assert_eq!(stops(&records("2:hold,3:resume", &[10.0, 10.0, 10.0, 10.0, 0.0])), [None, None]);
        // The program passed a stop on the way: the rest is the one that lasted.
        assert_eq!(stops(&records("1:hold", &[10.0, 0.0, 5.0, 0.0, 0.0])), [Some((3, 3, 0.05))]);
        // At rest already.
        assert_eq!(stops(&records("2:hold", &[10.0, 0.0, 0.0, 0.0])), [Some((2, 0, 0.0))]);
    }

    #[test]
    fn each_command_waits_for_what_ends_it() {
        // An override does not end a hold, nor a resume an override of 0 or an abort.
        let feeds = [10.0, 10.0, 10.0, 0.0, 0.0, 0.0];
        let found = records("1:hold,2:override=0.5,5:resume", &feeds);
        assert_eq!(stops(&found), [Some((3, 3, 0.2)), None, None]);
        let shares: Vec<_> = found.iter().map(|trace| trace.feed_override).collect();
        assert_eq!(shares, [None, Some(0.5), None]);
        assert_eq!(
            stops(&records("1:override=0,2:resume,4:override=1", &feeds)),
            [Some((3, 3, 0.2)), None, None]
        );
        // Without single block again before a block's end, the program's last rest is not its.
        assert_eq!(stops(&records("1:single,2:continuous", &feeds)), [None, None]);
        assert_eq!(stops(&records("1:single,5:resume", &feeds)), [Some((3, 3, 0.2)), None]);
        assert_eq!(stops(&records("2:abort,2:resume", &feeds)), [Some((3, 2, 0.1)), None]);
        // Commands after the last tick were not given.
        assert!(records("6:hold", &feeds).is_empty());
    }
}
