//! Ticks of the model without an event, each as one linear map.
//!
//! Between events the sub-steps of a tick are linear in the state at its start, the two commands that come out of the
//! dead time, and the signs of friction and limit. So is their product. It has the bits of no sub-step, but their values
//! to the last digits, for a fifth of the time.
//!
//! Whether a tick is free of events is judged from both its ends and from how far the demand can be off in between. In
//! doubt it is none: the sub-steps decide.

use wide::f64x4;

use super::simulation::{CROSSING, Delayed, LANES, Lane, Model, State};

/// What a map makes: position, last demand, and the state of the drive, and of a bed.
const ROWS: usize = 9;
const ROWS_RIGID: usize = 6;
/// Rows that are summed together.
const BLOCK: usize = 3;
const _: () = assert!(ROWS.is_multiple_of(BLOCK) && ROWS_RIGID.is_multiple_of(BLOCK));
/// Rows before those of the state, which are columns, too.
const OUTPUTS: usize = 2;
/// Columns of the map: the state, and up to four inputs.
const COLUMNS: usize = ROWS - OUTPUTS + 4;

/// Rates over one tick up to which both ends of it tell what is between.
const SLOW: f64 = 1.0;

/// Rows by blocks, each by lane.
type Column = [[f64x4; BLOCK]; ROWS / BLOCK];

/// What acts during a whole tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Regime {
    /// The axis stands: friction bears all.
    Stuck,
    /// Friction has one sign, the demand is within the limit.
    Sliding,
    /// Friction has one sign, the integrator stands, the demand is beyond the limit.
    Saturated,
}

impl Regime {
    /// Inputs besides the state: both commands, the sign of friction, the sign of the limit.
    fn inputs(self) -> usize {
        match self {
            Self::Stuck => 2,
            Self::Sliding => 3,
            Self::Saturated => 4,
        }
    }
}

/// The maps of a model.
pub(super) struct WholeTicks {
    tick_s: f64,
    stuck: Vec<Column>,
    sliding: Vec<Column>,
    saturated: Vec<Column>,
}

impl State {
    fn of_column(column: &[Lane; ROWS]) -> Self {
        let &[position, demand, command, integral, torque, velocity, bed, bed_velocity, bed_accel] = column;
        Self {
            command,
            integral,
            demand,
            torque,
            velocity,
            position,
            bed,
            bed_velocity,
            bed_accel,
            is_frozen: false,
        }
    }

    fn to_column(&self) -> [Lane; ROWS] {
        [
            self.position,
            self.demand,
            self.command,
            self.integral,
            self.torque,
            self.velocity,
            self.bed,
            self.bed_velocity,
            self.bed_accel,
        ]
    }
}

impl WholeTicks {
    /// `None` for a model that moves too much within a tick.
    pub(super) fn new(model: &Model, tick_s: f64, substeps: u32) -> Option<Self> {
        let is_slow = |lane: usize| {
            model.velocity_gain[lane] * tick_s <= SLOW && model.stiffness[lane].sqrt() * tick_s <= SLOW
        };
        let of = |regime| columns(model, substeps, regime);
        (0..LANES).all(is_slow).then(|| Self {
            tick_s,
            stuck: of(Regime::Stuck),
            sliding: of(Regime::Sliding),
            saturated: of(Regime::Saturated),
        })
    }

    /// Takes a tick at once, and says so, if it is free of events.
    #[inline]
    pub(super) fn advance(&self, model: &Model, state: &mut State, delayed: &Delayed) -> bool {
        if model.has_bed {
            self.advance_rows::<ROWS>(model, state, delayed)
        } else {
            self.advance_rows::<ROWS_RIGID>(model, state, delayed)
        }
    }

    #[inline(always)]
    fn advance_rows<const R: usize>(&self, model: &Model, state: &mut State, delayed: &Delayed) -> bool {
        let start = Start::of(model, state, delayed);
        let Some(regime) = start.regime(model, state) else { return false };
        let map = match regime {
            Regime::Stuck => &self.stuck,
            Regime::Sliding => &self.sliding,
            Regime::Saturated => &self.saturated,
        };
        let from = state.to_column();
        let mut inputs = [delayed.earlier, delayed.late, state.velocity, start.demand];
        inputs[2..].iter_mut().flatten().for_each(|value| *value = value.signum());
        let mut by = [f64x4::ZERO; COLUMNS];
        for (by, state) in by.iter_mut().zip(&from[OUTPUTS..R]) {
            *by = f64x4::from(*state);
        }
        for (by, input) in by[R - OUTPUTS..].iter_mut().zip(inputs) {
            *by = f64x4::from(input);
        }
        let mut column = [[0.0; LANES]; ROWS];
        // As many sums at a time as stay in registers.
        for block in 0..R / BLOCK {
            let mut sums = [f64x4::ZERO; BLOCK];
            for index in 0..map.len() {
                for row in 0..BLOCK {
                    sums[row] += map[index][block][row] * by[index];
                }
            }
            for row in 0..BLOCK {
                column[BLOCK * block + row] = sums[row].to_array();
            }
        }
        let mut end = State { is_frozen: state.is_frozen, ..State::of_column(&column) };
        if !start.is_without_events(regime, model, state, &end, self.tick_s) {
            return false;
        }
        end.position.iter_mut().zip(state.position).for_each(|(by, from)| *by += from);
        *state = end;
        true
    }
}

/// The map of a regime, column by column: what a tick makes of each state and input of 1.
fn columns(model: &Model, substeps: u32, regime: Regime) -> Vec<Column> {
    let states = if model.has_bed { ROWS } else { ROWS_RIGID } - OUTPUTS;
    let of = |index: usize| {
        let of_input = |input: usize| if index == states + input { [1.0; LANES] } else { [0.0; LANES] };
        let mut column = [[0.0; LANES]; ROWS];
        if index < states {
            column[OUTPUTS + index] = [1.0; LANES];
        }
        let mut state = State::of_column(&column);
        let delayed = Delayed { earlier: of_input(0), late: of_input(1) };
        let (friction, limit) = (of_input(2), of_input(3));
        for step in 0..substeps {
            let (error, demand) = model.ask(&mut state, &model.delayed_in(&delayed, step));
            let (runs, limited) = match regime {
                Regime::Saturated => (0.0, core::array::from_fn(|lane| limit[lane] * model.limit[lane])),
                Regime::Stuck | Regime::Sliding => (1.0, demand),
            };
            state.demand = demand;
            model.push(&mut state, &error, &[runs; LANES], &limited);
            model.travel(&mut state, |lane, pushed| match regime {
                Regime::Stuck => pushed,
                Regime::Sliding | Regime::Saturated => friction[lane] * model.coulomb_step[lane],
            });
        }
        let column = state.to_column();
        core::array::from_fn(|block| core::array::from_fn(|row| f64x4::from(column[BLOCK * block + row])))
    };
    (0..(states + regime.inputs()).min(COLUMNS)).map(of).collect()
}

/// What the first sub-step of a tick asks for.
struct Start {
    error: Lane,
    demand: Lane,
    /// How far the command jumps within the tick \[mm/s\].
    jump: Lane,
}

impl Start {
    #[inline(always)]
    fn of(model: &Model, state: &State, delayed: &Delayed) -> Self {
        let first = model.delayed_in(delayed, 0);
        let mut start = Self { error: [0.0; LANES], demand: [0.0; LANES], jump: [0.0; LANES] };
        for (lane, first) in first.iter().enumerate() {
            let command = state.command[lane] + model.filter_share[lane] * (first - state.command[lane]);
            start.error[lane] = command - state.velocity[lane];
            start.demand[lane] = model.velocity_gain[lane] * start.error[lane] + state.integral[lane];
            start.jump[lane] = (delayed.late[lane] - delayed.earlier[lane]).abs();
        }
        start
    }

    /// The regime that all lanes may be in.
    #[inline(always)]
    fn regime(&self, model: &Model, state: &State) -> Option<Regime> {
        let (mut within, mut beyond, mut moving, mut standing) = (true, true, true, true);
        for lane in 0..LANES {
            let (demand, limit) = (self.demand[lane].abs(), model.limit[lane]);
            let jump = model.velocity_gain[lane] * self.jump[lane];
            within &= demand + jump < (1.0 - CROSSING) * limit;
            beyond &= demand - jump > (1.0 + CROSSING) * limit;
            moving &= state.velocity[lane] != 0.0;
            standing &= state.velocity[lane] == 0.0;
        }
        match (within && !state.is_frozen, beyond && state.is_frozen) {
            (true, _) if moving => Some(Regime::Sliding),
            (true, _) if standing => Some(Regime::Stuck),
            (_, true) if moving => Some(Regime::Saturated),
            _ => None,
        }
    }

    /// Whether nothing can have happened between the start and this end of the tick.
    #[inline(always)]
    fn is_without_events(
        &self,
        regime: Regime,
        model: &Model,
        state: &State,
        end: &State,
        tick_s: f64,
    ) -> bool {
        let of = |lane: &Lane| f64x4::from(*lane);
        let (start, last, limit, jump) =
            (of(&self.demand), of(&end.demand), of(&model.limit), of(&self.jump));
        let half = f64x4::splat(0.5 * tick_s);
        // What the demand, and what the acceleration may vary by.
        let varies = (last - start).abs() + of(&model.velocity_gain) * jump;
        let bed_varies = (of(&end.bed_accel) - of(&state.bed_accel)).abs();
        let sign_of = |value: f64x4| f64x4::ONE.copysign(value);
        let slides = |accel_varies: f64x4| {
            let sign = sign_of(of(&state.velocity));
            let least = (sign * of(&state.velocity)).fast_min(sign * of(&end.velocity));
            least.simd_gt(half * (accel_varies + bed_varies))
        };
        let within = f64x4::splat(1.0 - CROSSING) * limit;
        let is_within = (start.abs().fast_max(last.abs()) + varies).simd_lt(within);
        let torque = of(&state.torque);
        let pushes = (start - torque).abs() + varies;
        let is_without = match regime {
            Regime::Sliding => is_within & slides(pushes),
            Regime::Stuck => {
                let pushed = (torque - of(&state.bed_accel)).abs() + pushes + bed_varies;
                is_within & (f64x4::splat(model.step_s) * pushed).simd_lt(of(&model.coulomb_step))
            }
            Regime::Saturated => {
                let (sign, error) = (sign_of(start), of(&self.error));
                let end_error = of(&end.command) - of(&end.velocity);
                let error_varies = (end_error - error).abs() + jump;
                let beyond = f64x4::splat(1.0 + CROSSING) * limit;
                ((sign * start).fast_min(sign * last) - varies).simd_gt(beyond)
                    & (sign * error).simd_gt(error_varies)
                    & slides(f64x4::splat(2.0) * (sign * limit - torque).abs())
            }
        };
        is_without.all()
    }
}
