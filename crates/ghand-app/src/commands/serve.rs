//! `ghand serve`: shows avatars in a browser on this computer.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use ghand_avatar::Avatar;
use ghand_motion::pose_sequence::formats::ghand::poses_json;

use crate::pose_choice::PoseReadingArgs;
use crate::say;
use crate::web_page::{PlayerPage, SCRIPT, Source, WASM};

/// Largest head of a request, bytes.
const LARGEST_HEAD: usize = 16 << 10;
/// Most headers of a request.
const MOST_HEADERS: usize = 100;
/// Most bytes of a request that are taken after the answer.
const MOST_LEFT: u64 = 1 << 20;
/// A client that is silent for this long is disconnected.
const SILENCE: Duration = Duration::from_secs(5);
/// After a failed call of the system, so that a lasting failure does not use up a processor.
const AFTER_FAILURE: Duration = Duration::from_millis(50);
/// Most connections at once.
const MOST_CONNECTIONS: usize = 32;

/// Command line of `ghand serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// The avatars, .ghand files, in one scene
    #[arg(value_name = "AVATAR", required = true)]
    avatars: Vec<PathBuf>,
    /// The motion that is played, by name, or a file of poses
    #[arg(long, value_name = "FILE|NAME")]
    motion: Option<String>,
    /// The port on this computer; 0 takes any that is free
    #[arg(long, value_name = "N", default_value_t = 4264)]
    port: u16,
}

/// A file of the server.
struct Served {
    path: String,
    kind: &'static str,
    bytes: Vec<u8>,
}

/// Serves until the program is ended.
///
/// # Errors
/// If an avatar or the poses cannot be read, or the port is not free.
pub fn run(args: &ServeArgs) -> anyhow::Result<()> {
    let files = Arc::new(files(args)?);
    let port = args.port;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
        .with_context(|| format!("--port {port}: cannot be opened; choose another, or 0 for any that is free"))?;
    let port = listener.local_addr().context("the server's own address")?.port();
    say!("http://localhost:{port}/ shows {}; Ctrl-C ends it", names(&args.avatars));
    let open = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming() {
        let Ok(stream) = stream else {
            thread::sleep(AFTER_FAILURE);
            continue;
        };
        if open.fetch_add(1, Ordering::Relaxed) >= MOST_CONNECTIONS {
            open.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let files = files.clone();
        let open = open.clone();
        thread::spawn(move || {
            // A client that goes away is no error of the server.
            let _ = answer(stream, &files);
            open.fetch_sub(1, Ordering::Relaxed);
        });
    }
    Ok(())
}

fn names(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" and ")
}

/// The page, the player and the avatars, all read and checked.
fn files(args: &ServeArgs) -> anyhow::Result<Vec<Served>> {
    let mut files = Vec::new();
    let mut page = PlayerPage { title: format!("{} - ghand", names(&args.avatars)), ..PlayerPage::default() };
    for (number, path) in args.avatars.iter().enumerate() {
        let avatar = Avatar::load(path)?;
        let bytes = std::fs::read(path).with_context(|| format!("{}: cannot be read", path.display()))?;
        if let (0, Some(motion)) = (number, &args.motion) {
            page.motion = Some(motion_source(motion, &avatar)?);
        }
        let name = format!("avatar-{number}.ghand");
        page.avatars.push(Source::At(name.clone()));
        files.push(Served { path: format!("/{name}"), kind: "application/octet-stream", bytes });
    }
    let mut file = |path: &str, kind, bytes: &[u8]| files.push(Served { path: path.into(), kind, bytes: bytes.into() });
    file("/", "text/html; charset=utf-8", page.beside_player().as_bytes());
    file("/ghand-avatar.js", "text/javascript; charset=utf-8", SCRIPT.as_bytes());
    file("/ghand.wasm", "application/wasm", WASM);
    Ok(files)
}

/// A motion for a page: by name, or the poses of a file, read for this avatar.
///
/// # Errors
/// As in [`PoseReadingArgs::load`].
pub fn motion_source(motion: &str, avatar: &Avatar) -> anyhow::Result<Source> {
    let sequence = PoseReadingArgs::default().load(motion, &avatar.model)?;
    if crate::pose_choice::is_name(motion) {
        return Ok(Source::At(motion.into()));
    }
    Ok(Source::Inside { kind: "application/json", bytes: poses_json(&sequence, &avatar.model).into_bytes() })
}

/// Reads one request and answers it.
fn answer(mut stream: TcpStream, files: &[Served]) -> io::Result<()> {
    stream.set_read_timeout(Some(SILENCE))?;
    stream.set_write_timeout(Some(SILENCE))?;
    let mut head = Vec::new();
    let mut part = [0; 2048];
    let (status, file) = loop {
        let read = stream.read(&mut part)?;
        if read == 0 {
            return Ok(());
        }
        head.extend_from_slice(&part[..read]);
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(&head) {
            Ok(httparse::Status::Complete(_)) => break found(&request, files),
            Ok(httparse::Status::Partial) if head.len() < LARGEST_HEAD => {}
            _ => break ("400 Bad Request", None),
        }
    };
    let is_head = head.starts_with(b"HEAD ");
    let (kind, bytes) = file.map_or(("text/plain", status.as_bytes()), |file| (file.kind, &file.bytes[..]));
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-cache\r\n\
         X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n",
        bytes.len()
    )?;
    if !is_head {
        stream.write_all(bytes)?;
    }
    stream.shutdown(Shutdown::Write)?;
    // What is left of the request is taken: a connection that is closed before is reset, and the answer lost.
    io::copy(&mut stream.take(MOST_LEFT), &mut io::sink()).map(drop)
}

/// The status of a request, and the file that it asks for.
fn found<'a>(request: &httparse::Request<'_, '_>, files: &'a [Served]) -> (&'static str, Option<&'a Served>) {
    // Another name for this computer may be a foreign page's, which must not read the avatar.
    let host = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case("host"));
    let host = host.and_then(|header| std::str::from_utf8(header.value).ok()).unwrap_or_default();
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    if !["localhost", "127.0.0.1"].contains(&name) {
        return ("403 Forbidden", None);
    }
    if !matches!(request.method, Some("GET" | "HEAD")) {
        return ("405 Method Not Allowed", None);
    }
    let path = request.path.unwrap_or_default();
    let path = path.split(['?', '#']).next().unwrap_or_default();
    match files.iter().find(|file| file.path == path) {
        Some(file) => ("200 OK", Some(file)),
        None => ("404 Not Found", None),
    }
}
