//! The port: a WebSocket and UDP under one number, for programs and pages of this computer only.
//!
//! One thread accepts connections and has one thread for each, another takes datagrams. All of them block, so that a
//! packet is taken when it arrives; to close the port, each is woken through its own socket.

mod mailbox;
mod origin;

use std::io;
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tungstenite::handshake::server::{Callback, ErrorResponse, Request, Response};
use tungstenite::http::StatusCode;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, accept_hdr_with_config};

use super::LARGEST_PACKET;
pub use mailbox::{Mailbox, Packet, Tally};
use origin::is_allowed;

/// The port if the user names none: "hand" on the keys of a telephone.
pub const DEFAULT_PORT: u16 = 4263;

/// Most connections at once: a tracker has one.
const MOST_CONNECTIONS: usize = 8;
/// A client that is silent for this long while it connects is disconnected.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// A client that does not take an answer for this long is disconnected.
const ANSWER: Duration = Duration::from_secs(1);
/// After a failed call of the system, so that a lasting failure does not use up a processor.
const AFTER_FAILURE: Duration = Duration::from_millis(50);

/// Which port takes live poses, and whose pages may use it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LiveSettings {
    /// The port on this computer; 0 for any that is free.
    pub port: u16,
    /// Origins of pages that may use it, beside those of this computer.
    pub origins: Vec<String>,
}

impl Default for LiveSettings {
    fn default() -> Self {
        LiveSettings { port: DEFAULT_PORT, origins: Vec::new() }
    }
}

/// A port that cannot be opened: cause and remedy in one sentence.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PortError(String);

/// An open port. Dropping it closes the port and ends its threads.
pub struct LivePort {
    number: u16,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    mailbox: Mailbox,
    origins: Vec<String>,
    closing: AtomicBool,
}

impl Shared {
    fn is_closing(&self) -> bool {
        self.closing.load(Ordering::SeqCst)
    }
}

impl LivePort {
    /// Opens the port.
    ///
    /// # Errors
    /// One sentence if the number is taken or not allowed, or if threads cannot be started.
    pub fn open(settings: &LiveSettings) -> Result<LivePort, PortError> {
        let refused = |number: u16| move |error: io::Error| refusal(number, &error);
        let tcp = TcpListener::bind((Ipv4Addr::LOCALHOST, settings.port)).map_err(refused(settings.port))?;
        let number = tcp.local_addr().map_err(refused(settings.port))?.port();
        let udp = UdpSocket::bind((Ipv4Addr::LOCALHOST, number)).map_err(refused(number))?;
        let shared = Arc::new(Shared {
            mailbox: Mailbox::default(),
            origins: settings.origins.clone(),
            closing: AtomicBool::new(false),
        });
        let mut port = LivePort { number, shared: shared.clone(), threads: Vec::new() };
        let thread = |name: &str| thread::Builder::new().name(format!("live {name}"));
        let failed = |error: io::Error| PortError(format!("live poses: no thread can be started: {error}"));
        let own = shared.clone();
        port.threads.push(thread("connections").spawn(move || accept(&tcp, &own)).map_err(failed)?);
        port.threads.push(thread("datagrams").spawn(move || take_datagrams(&udp, &shared)).map_err(failed)?);
        Ok(port)
    }

    /// The number of the port.
    pub fn number(&self) -> u16 {
        self.number
    }

    /// Where its packets wait.
    pub fn mailbox(&self) -> &Mailbox {
        &self.shared.mailbox
    }
}

impl Drop for LivePort {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::SeqCst);
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, self.number));
        // Both only wake their threads. If one fails, its socket has so much to do that its thread is awake.
        _ = TcpStream::connect_timeout(&address, ANSWER);
        _ = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|socket| socket.send_to(&[], address));
        for thread in self.threads.drain(..) {
            // It has ended in any case.
            _ = thread.join();
        }
    }
}

fn refusal(number: u16, error: &io::Error) -> PortError {
    PortError(match error.kind() {
        io::ErrorKind::AddrInUse => format!(
            "port {number} is already in use, perhaps by another viewer; close that program, or start with another \
             port (--live=PORT)"
        ),
        io::ErrorKind::PermissionDenied => {
            format!("port {number} is not allowed: {error}; choose one above 1023 (--live=PORT)")
        }
        _ => format!("port {number} cannot be opened: {error}; choose another (--live=PORT)"),
    })
}

fn take_datagrams(socket: &UdpSocket, shared: &Shared) {
    let mut buffer = vec![0; LARGEST_PACKET];
    loop {
        let received = socket.recv(&mut buffer);
        if shared.is_closing() {
            return;
        }
        match received.map(|size| buffer.get(..size)) {
            Ok(Some([]) | None) => {}
            Ok(Some(packet)) => shared.mailbox.put(packet.to_vec(), Instant::now()),
            // Windows reports here that an earlier answer did not arrive.
            Err(_) => thread::sleep(AFTER_FAILURE),
        }
    }
}

/// A client and the thread that serves it.
struct Connection {
    stream: TcpStream,
    thread: JoinHandle<()>,
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    let mut connections: Vec<Connection> = Vec::new();
    loop {
        let accepted = listener.accept();
        if shared.is_closing() {
            break;
        }
        connections.retain(|connection| !connection.thread.is_finished());
        match accepted {
            Ok(_) if connections.len() >= MOST_CONNECTIONS => {
                shared.mailbox.refuse(format!("more than {MOST_CONNECTIONS} connections"));
            }
            Ok((stream, _)) => connections.extend(serve(stream, shared)),
            Err(_) => thread::sleep(AFTER_FAILURE),
        }
    }
    for Connection { stream, thread } in connections {
        // The client may have closed it already.
        _ = stream.shutdown(Shutdown::Both);
        _ = thread.join();
    }
}

/// Starts a thread for a client; `None` if that is impossible, and the client is disconnected.
fn serve(stream: TcpStream, shared: &Arc<Shared>) -> Option<Connection> {
    let own = stream.try_clone().ok()?;
    let shared = shared.clone();
    let take = move || {
        if let Err(Error::Capacity(_)) = take_messages(&own, &shared) {
            shared.mailbox.refuse(format!("packet: is larger than {} KiB", LARGEST_PACKET >> 10));
        }
        // The other handle keeps the connection open; the client may have closed it already.
        _ = own.shutdown(Shutdown::Both);
    };
    let thread = thread::Builder::new().name("live connection".into()).spawn(take).ok()?;
    Some(Connection { stream, thread })
}

/// Takes the messages of a client until it leaves or breaks a rule.
fn take_messages(stream: &TcpStream, shared: &Shared) -> tungstenite::Result<()> {
    stream.set_read_timeout(Some(HANDSHAKE))?;
    stream.set_write_timeout(Some(ANSWER))?;
    let config = WebSocketConfig::default()
        .read_buffer_size(16 << 10)
        .write_buffer_size(0)
        .max_write_buffer_size(LARGEST_PACKET)
        .max_frame_size(Some(LARGEST_PACKET))
        .max_message_size(Some(LARGEST_PACKET));
    let Ok(mut socket) = accept_hdr_with_config(stream, OriginCheck(shared), Some(config)) else { return Ok(()) };
    stream.set_read_timeout(None)?;
    loop {
        match socket.read()? {
            Message::Text(text) => shared.mailbox.put(text.as_bytes().to_vec(), Instant::now()),
            Message::Binary(bytes) => shared.mailbox.put(bytes.to_vec(), Instant::now()),
            // Pings and closing are answered in `read`.
            Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_) => {}
        }
    }
}

/// Refuses pages from elsewhere while they connect.
struct OriginCheck<'a>(&'a Shared);

impl Callback for OriginCheck<'_> {
    fn on_request(self, request: &Request, response: Response) -> Result<Response, ErrorResponse> {
        let mut origins = request.headers().get_all("Origin").iter();
        // What is not text is no origin that anyone allows.
        let origin = origins.next().map(|origin| origin.to_str().unwrap_or_default());
        if origins.next().is_none() && is_allowed(origin, &self.0.origins) {
            return Ok(response);
        }
        let origin: String = origin.unwrap_or_default().chars().take(80).collect();
        self.0.mailbox.refuse(format!("a page of {origin} was refused; --live-origin {origin} allows it"));
        let mut answer = ErrorResponse::new(Some("this page may not send live poses\n".into()));
        *answer.status_mut() = StatusCode::FORBIDDEN;
        Err(answer)
    }
}

#[cfg(test)]
mod tests;
