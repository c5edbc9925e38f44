//! motion
fn main() {}
