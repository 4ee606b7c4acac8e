use std::io::{Read, Write};
use std::sync::Weak;
use std::time::Instant;

use tungstenite::client::client_with_config;
use tungstenite::handshake::client::generate_key;
use tungstenite::{HandshakeError, WebSocket};

use super::*;

fn open() -> LivePort {
    LivePort::open(&LiveSettings { port: 0, origins: vec!["https://hands.example".into()] }).unwrap()
}

/// Connects as a page of this origin does.
fn connect(port: &LivePort, origin: Option<&str>) -> Result<WebSocket<TcpStream>, u16> {
    let stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port.number())).unwrap();
    let host = format!("127.0.0.1:{}", port.number());
    let mut request = tungstenite::http::Request::builder()
        .uri(format!("ws://{host}/"))
        .header("Host", host)
        .header("Connection", "Upgrade")
        .header("Upgrade", "websocket")
        .header("Sec-WebSocket-Version", "13")
        .header("Sec-WebSocket-Key", generate_key());
    if let Some(origin) = origin {
        request = request.header("Origin", origin);
    }
    match client_with_config(request.body(()).unwrap(), stream, None) {
        Ok((socket, _)) => Ok(socket),
        Err(HandshakeError::Failure(Error::Http(answer))) => Err(answer.status().as_u16()),
        // Closed without an answer.
        Err(_) => Err(0),
    }
}

fn send_datagram(port: &LivePort, bytes: &[u8]) {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    socket.send_to(bytes, (Ipv4Addr::LOCALHOST, port.number())).unwrap();
}

/// Waits for something that other threads do.
fn wait_for(what: &str, mut is_there: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_there() {
        assert!(start.elapsed() < Duration::from_secs(20), "waited in vain for {what}");
        thread::sleep(Duration::from_millis(2));
    }
}

fn wait_for_packets(port: &LivePort, count: u64) {
    wait_for(&format!("{count} packets"), || port.mailbox().tally().received >= count);
}

fn texts(port: &LivePort) -> Vec<String> {
    port.mailbox().take().into_iter().map(|packet| String::from_utf8(packet.bytes).unwrap()).collect()
}

#[test]
fn packets_of_two_clients_and_datagrams_arrive() {
    let port = open();
    let mut clients = [connect(&port, None).unwrap(), connect(&port, Some("null")).unwrap()];
    clients[0].send(Message::text("a")).unwrap();
    wait_for_packets(&port, 1);
    clients[1].send(Message::binary(b"b".to_vec())).unwrap();
    wait_for_packets(&port, 2);
    send_datagram(&port, b"c");
    wait_for_packets(&port, 3);
    assert_eq!(texts(&port), ["a", "b", "c"]);
    // A ping is answered, and a client that leaves makes room for others.
    clients[0].send(Message::Ping("hello".into())).unwrap();
    assert_eq!(clients[0].read().unwrap(), Message::Pong("hello".into()));
    let [first, mut second] = clients;
    drop(first);
    second.close(None).unwrap();
    assert!(matches!(second.read(), Ok(Message::Close(_))));
    assert!(second.read().is_err(), "the port has not closed the connection");
    for _ in 0..3 * MOST_CONNECTIONS {
        wait_for("room", || connect(&port, None).is_ok());
    }
}

#[test]
fn a_flood_leaves_only_the_newest_packets() {
    let port = open();
    let mut client = connect(&port, None).unwrap();
    let count = 20_000u64;
    for k in 0..count {
        client.send(Message::text(k.to_string())).unwrap();
    }
    wait_for_packets(&port, count);
    assert_eq!(texts(&port), ["19996", "19997", "19998", "19999"]);
    let tally = port.mailbox().tally();
    assert_eq!((tally.received, tally.dropped, tally.unusable), (count, count - 4, 0));
}

#[test]
fn pages_from_elsewhere_are_refused_and_counted() {
    let port = open();
    for origin in [Some("https://example.org"), Some("http://localhost.example.org"), Some("")] {
        assert_eq!(connect(&port, origin).err(), Some(403), "{origin:?}");
    }
    for origin in [None, Some("null"), Some("http://localhost:8000"), Some("https://hands.example")] {
        assert!(connect(&port, origin).is_ok(), "{origin:?}");
    }
    let tally = port.mailbox().tally();
    assert_eq!(tally.unusable, 3);
    connect(&port, Some("https://example.org")).unwrap_err();
    assert!(port.mailbox().tally().reason.contains("--live-origin https://example.org"));
}

#[test]
fn a_packet_that_is_too_large_ends_its_connection_only() {
    let port = open();
    let mut clients = [connect(&port, None).unwrap(), connect(&port, None).unwrap()];
    // The port may close the connection while the rest is being sent.
    _ = clients[0].send(Message::text("x".repeat(LARGEST_PACKET + 1)));
    wait_for("the refusal", || port.mailbox().tally().unusable == 1);
    assert_eq!(port.mailbox().tally().reason, "packet: is larger than 64 KiB");
    wait_for("the end", || clients[0].read().is_err());
    clients[1].send(Message::text("x".repeat(LARGEST_PACKET))).unwrap();
    wait_for_packets(&port, 1);
    assert_eq!(port.mailbox().tally().received, 1);
}

#[test]
fn too_many_connections_and_those_that_are_no_websocket_are_closed() {
    let port = open();
    let mut other = TcpStream::connect((Ipv4Addr::LOCALHOST, port.number())).unwrap();
    other.write_all(b"GET / HTTP/1.0\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    other.read_to_end(&mut answer).unwrap();
    assert!(answer.is_empty());
    let port = open();
    let clients: Vec<_> = (0..MOST_CONNECTIONS).map(|_| connect(&port, None).unwrap()).collect();
    let mut late = TcpStream::connect((Ipv4Addr::LOCALHOST, port.number())).unwrap();
    assert!(late.read(&mut [0]).map_or(true, |size| size == 0), "it is still open");
    assert_eq!(port.mailbox().tally().unusable, 1);
    assert_eq!(clients.len(), MOST_CONNECTIONS);
}

#[test]
fn a_closed_port_leaves_no_thread_and_can_be_opened_again_at_once() {
    let mut number = 0;
    for _ in 0..5 {
        let port = LivePort::open(&LiveSettings { port: number, origins: vec![] }).unwrap();
        number = port.number();
        // One client that talks, one that is silent before the handshake.
        let mut client = connect(&port, None).unwrap();
        let mut silent = TcpStream::connect((Ipv4Addr::LOCALHOST, number)).unwrap();
        client.send(Message::text("a")).unwrap();
        wait_for_packets(&port, 1);
        let shared: Weak<Shared> = Arc::downgrade(&port.shared);
        drop(port);
        // Every thread holds it.
        assert!(shared.upgrade().is_none(), "a thread still runs");
        assert!(client.read().is_err());
        assert!(silent.read(&mut [0]).map_or(true, |size| size == 0));
    }
}

#[test]
fn a_port_in_use_is_one_clear_sentence() {
    let port = open();
    let settings = LiveSettings { port: port.number(), origins: vec![] };
    let error = LivePort::open(&settings).err().unwrap().to_string();
    assert!(error.starts_with(&format!("port {} is already in use", port.number())), "{error}");
    assert!(error.contains("--live=PORT") && !error.contains("os error"), "{error}");
}
