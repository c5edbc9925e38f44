//! The page and its sockets, over HTTP.
//!
//! Loopback only, unless there is a token. A page of another site can't command a machine: where there is no token, the address that
//! the browser asked for must be this computer, and a socket must be opened by this page.

use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::mpsc::{Receiver, channel};

use super::desk::{Desk, Order, Pictures, Tab};
use super::message::{Said, Told};
use crate::report::{PageRun, panel_page};

/// Texts that wait for a tab; half of them are for those that it needs.
const WAITING: usize = 64;
/// A tab that takes longer for a message has gone.
const SLOWEST: Duration = Duration::from_secs(2);
/// The longest program that a tab may load \[bytes\].
const PROGRAM_MAX: usize = 64 << 20;

/// Who may come.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Access {
    /// Whoever knows it, from anywhere; without it, this computer alone.
    pub token: Option<String>,
}

impl Access {
    /// Whether a request is let in, by its headers `Host` and `Origin` and the query of its address.
    #[must_use]
    pub fn lets_in(&self, host: Option<&str>, origin: Option<&str>, query: Option<&str>) -> bool {
        let Some(host) = host else { return false };
        // A socket of another site's page.
        if origin.is_some_and(|origin| origin.strip_prefix("http://") != Some(host)) {
            return false;
        }
        match &self.token {
            Some(token) => query
                .is_some_and(|query| query.split('&').any(|pair| pair.strip_prefix("token=") == Some(token))),
            None => {
                // A name of another site may lead here.
                let name = match host.rsplit_once(':') {
                    Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
                    _ => host,
                };
                matches!(name, "localhost" | "127.0.0.1" | "[::1]")
            }
        }
    }
}

#[derive(Clone)]
struct Served {
    access: Access,
    orders: Sender<Order>,
    pictures: Pictures,
    tabs: Arc<AtomicU64>,
}

/// Serves the panel of a desk until `is_over`, which is asked ten times a second.
///
/// # Errors
/// The listener can't be used.
pub fn serve(
    listener: TcpListener,
    desk: &Desk,
    access: Access,
    is_over: &mut dyn FnMut() -> bool,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let served = Served { access, orders: desk.orders(), pictures: desk.pictures(), tabs: Arc::default() };
    let router = Router::new()
        .route("/", get(page))
        .route("/socket", get(socket))
        .route("/picture/{number}/data", get(data))
        .route("/picture/{number}/program", get(program))
        .layer(middleware::from_fn_with_state(served.clone(), guard))
        .with_state(served);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let over = async {
            while !is_over() && !desk.has_ended() {
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        };
        tokio::select! {
            served = axum::serve(listener, router) => served,
            () = over => Ok(()),
        }
    })
}

async fn guard(State(served): State<Served>, request: Request, next: Next) -> Response {
    let is_let_in = {
        let of = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
        served.access.lets_in(of(header::HOST), of(header::ORIGIN), request.uri().query())
    };
    if is_let_in {
        return next.run(request).await;
    }
    let text = "found a stranger, expected this computer, or the panel's token: open the address that `motion panel` printed\n";
    (StatusCode::FORBIDDEN, text).into_response()
}

async fn page() -> Response {
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
        // A token stays here.
        (header::REFERRER_POLICY, "no-referrer"),
        // No other page frames this one, to have it clicked.
        (header::X_FRAME_OPTIONS, "DENY"),
    ];
    (headers, panel_page()).into_response()
}

fn bytes(found: Option<&[u8]>, otherwise: StatusCode) -> Response {
    match found {
        Some(bytes) => ([(header::CONTENT_TYPE, "application/zlib")], bytes.to_vec()).into_response(),
        None => otherwise.into_response(),
    }
}

async fn data(State(served): State<Served>, Path(number): Path<u64>) -> Response {
    let picture = served.pictures.get(number);
    bytes(picture.as_deref().map(PageRun::data), StatusCode::NOT_FOUND)
}

async fn program(State(served): State<Served>, Path(number): Path<u64>) -> Response {
    match served.pictures.get(number) {
        // Ticks that were captured have none.
        Some(picture) => bytes(picture.program(), StatusCode::NO_CONTENT),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn socket(State(served): State<Served>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    // Only browsers' pages have a use for a socket, and they name theirs.
    if headers.get(header::ORIGIN).is_none() {
        return StatusCode::FORBIDDEN.into_response();
    }
    upgrade.max_message_size(PROGRAM_MAX).max_frame_size(PROGRAM_MAX).on_upgrade(|socket| async move {
        let tab = served.tabs.fetch_add(1, Ordering::Relaxed);
        attend(socket, tab, &served.orders).await;
        // A desk that has ended needs no telling.
        let _ = served.orders.send(Order::Left(tab));
    })
}

/// Until the tab has gone.
async fn attend(mut socket: WebSocket, tab: Tab, orders: &Sender<Order>) {
    let (to, mut told) = channel::<String>(WAITING);
    let listener = Box::new(move |text: &str, is_needed: bool| {
        let has_room = is_needed || to.capacity() > WAITING / 2;
        has_room && to.try_send(text.to_owned()).is_ok()
    });
    if orders.send(Order::Joined(tab, listener)).is_err() {
        return;
    }
    while let Some(step) = next_step(&mut socket, &mut told).await {
        let is_taken = match step {
            Step::Tell(text) => tell(&mut socket, text).await,
            Step::Heard(text) => match serde_json::from_str::<Said>(&text) {
                Ok(said) => orders.send(Order::Command(tab, said)).is_ok(),
                Err(error) => {
                    let text = format!("found a command that is none: {error}");
                    let told = serde_json::to_string(&Told::Refused { text: &text }).expect("a text");
                    tell(&mut socket, told).await
                }
            },
        };
        if !is_taken {
            return;
        }
    }
}

/// Tells a tab; false where it has gone, or takes nothing. While it is told, it is not heard.
async fn tell(socket: &mut WebSocket, text: String) -> bool {
    let told = tokio::time::timeout(SLOWEST, socket.send(Message::text(text)));
    matches!(told.await, Ok(Ok(())))
}

enum Step {
    Tell(String),
    Heard(String),
}

/// What there is to tell, or what was heard; none when the tab, or the desk, has gone.
async fn next_step(socket: &mut WebSocket, told: &mut Receiver<String>) -> Option<Step> {
    loop {
        tokio::select! {
            text = told.recv() => return text.map(Step::Tell),
            heard = socket.recv() => match heard?.ok()? {
                Message::Text(text) => return Some(Step::Heard(text.to_string())),
                Message::Close(_) => return None,
                // Pings are answered by the library.
                _ => {}
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_sites_and_strangers_are_kept_out() {
        let local = Access::default();
        for host in ["localhost:5080", "127.0.0.1:5080", "[::1]:5080", "localhost"] {
            assert!(local.lets_in(Some(host), None, None), "{host}");
            assert!(local.lets_in(Some(host), Some(&format!("http://{host}")), None), "{host}");
            assert!(!local.lets_in(Some(host), Some("http://evil.example"), None), "{host}");
            assert!(!local.lets_in(Some(host), Some("null"), None), "{host}");
        }
        // Names that lead here.
        for host in ["evil.example:5080", "localhost.evil.example", "192.168.1.7:5080", ""] {
            assert!(!local.lets_in(Some(host), None, None), "{host}");
        }
        assert!(!local.lets_in(None, None, None));
        let far = Access { token: Some("abc".to_owned()) };
        let host = Some("192.168.1.7:5080");
        assert!(far.lets_in(host, None, Some("token=abc")));
        assert!(far.lets_in(host, Some("http://192.168.1.7:5080"), Some("x=1&token=abc")));
        assert!(!far.lets_in(host, Some("http://evil.example"), Some("token=abc")));
        for query in [None, Some(""), Some("token="), Some("token=abcd"), Some("atoken=abc")] {
            assert!(!far.lets_in(host, None, query), "{query:?}");
        }
    }
}
