//! The programs that the repository has.

/// Names and texts.
pub const SAMPLES: [(&str, &str); 6] = [
    ("modes", include_str!("../programs/modes.ngc")),
    ("nameplate", include_str!("../programs/nameplate_inch.ngc")),
    ("pockets", include_str!("../programs/pockets.ngc")),
    ("stairs", include_str!("../programs/stairs_incremental.ngc")),
    ("thread mill", include_str!("../programs/thread_mill_helix.ngc")),
    ("stringer", include_str!("../../host/src/cli/stringer.ngc")),
];
