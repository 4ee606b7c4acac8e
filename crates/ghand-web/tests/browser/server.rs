//! A server for one page: files, what the page posts, and a WebSocket that sends one packet again and again.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What the page has posted: path and body.
pub type Post = (String, Vec<u8>);

pub struct Server {
    pub port: u16,
    pub posts: Mutex<Receiver<Post>>,
}

/// Serves these files until the test ends.
pub fn serve(files: BTreeMap<String, (&'static str, Vec<u8>)>, packet: String) -> Server {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let (sender, posts) = channel();
    let files = Arc::new(files);
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let files = files.clone();
            let sender = sender.clone();
            let packet = packet.clone();
            std::thread::spawn(move || answer(stream, &files, &sender, &packet));
        }
    });
    Server { port, posts: Mutex::new(posts) }
}

fn answer(
    mut stream: TcpStream,
    files: &BTreeMap<String, (&'static str, Vec<u8>)>,
    posts: &Sender<Post>,
    packet: &str,
) {
    let mut first = [0; 16];
    let peeked = stream.peek(&mut first).unwrap_or(0);
    if first[..peeked].starts_with(b"GET /socket") {
        let Ok(mut socket) = tungstenite::accept(stream) else { return };
        while socket.send(packet.into()).is_ok() {
            std::thread::sleep(Duration::from_millis(100));
        }
        return;
    }
    let mut bytes = Vec::new();
    let mut part = vec![0; 1 << 16];
    let (method, path, begin, length) = loop {
        match stream.read(&mut part) {
            Ok(read) if read > 0 => bytes.extend_from_slice(&part[..read]),
            _ => return,
        }
        let mut headers = [httparse::EMPTY_HEADER; 64];
        let mut request = httparse::Request::new(&mut headers);
        if let Ok(httparse::Status::Complete(begin)) = request.parse(&bytes) {
            let length = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case("content-length"));
            let length = length.map_or(0, |header| std::str::from_utf8(header.value).unwrap().parse().unwrap());
            break (request.method.unwrap().to_owned(), request.path.unwrap().to_owned(), begin, length);
        }
    };
    while bytes.len() < begin + length {
        match stream.read(&mut part) {
            Ok(read) if read > 0 => bytes.extend_from_slice(&part[..read]),
            _ => return,
        }
    }
    let nothing = ("text/plain", Vec::new());
    let (status, (kind, body)) = if method == "POST" {
        let _ = posts.send((path, bytes[begin..].to_vec()));
        ("200 OK", &nothing)
    } else {
        files.get(&path).map_or(("404 Not Found", &nothing), |file| ("200 OK", file))
    };
    let length = body.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(body));
}
