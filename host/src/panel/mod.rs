//! A panel in the browser: an operator's view of a board.
//!
//! ```text
//!  tab ◄─ WebSocket ─► server ─ Order ─► desk ─► Board ─► wire, or the simulated machine
//!                             ◄─ text ──
//! ```
//!
//! - [`message`]: what tabs and panel say to each other, in JSON;
//! - [`picture`]: a program as it would be driven;
//! - [`desk`]: the one thread that has the board, and who commands it;
//! - [`server`]: the page and its sockets.
//!
//! Nothing of this decides about motion: a board whose panel has gone comes to rest by itself, on the path.

pub mod message;
pub mod picture;
pub mod desk;
pub mod server;
