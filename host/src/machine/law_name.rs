//! The names of the feed law's shapes, as machine files and block lists have them.

use motion_kernel::law::Pulse;

/// What is expected where one of them stands.
pub(crate) const LAW_NAMES: &str = "\"sin2\" or \"plateau\"";

/// The shape of that name; `None` for anything else, and for what is no text.
pub(crate) fn law_named(name: Option<&str>) -> Option<Pulse> {
    [Pulse::Sin2, Pulse::Plateau].into_iter().find(|pulse| name == Some(pulse.name()))
}
