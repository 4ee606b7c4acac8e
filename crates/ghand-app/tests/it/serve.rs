//! `ghand serve`: the page and its files, to this computer only.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

struct Server {
    process: Child,
    port: u16,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn demo() -> String {
    format!("{}/../../assets/demo-avatar/right.ghand", env!("CARGO_MANIFEST_DIR"))
}

fn serve(arguments: &[&str]) -> Server {
    let mut process = Command::new(env!("CARGO_BIN_EXE_ghand"))
        .args(["serve", &demo(), "--port", "0"])
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let port = line.strip_prefix("http://localhost:").and_then(|rest| rest.split('/').next()?.parse().ok());
    Server { port: port.unwrap_or_else(|| panic!("{line}")), process }
}

impl Server {
    /// Sends bytes and returns head and body of the answer.
    fn ask(&self, request: &str) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let body = bytes.split_off(end + 4);
        (String::from_utf8(bytes).unwrap(), body)
    }

    fn get(&self, path: &str) -> (String, Vec<u8>) {
        self.ask(&format!("GET {path} HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", self.port))
    }
}

#[test]
fn the_page_names_files_that_are_there() {
    let server = serve(&["--motion", "count"]);
    let (head, page) = server.get("/");
    let page = String::from_utf8(page).unwrap();
    assert!(head.starts_with("HTTP/1.1 200 OK") && head.contains("text/html"), "{head}");
    assert!(page.contains(r#"src="avatar-0.ghand""#) && page.contains(r#"motion="count""#), "{page}");
    assert!(page.contains(r#"src="ghand-avatar.js""#), "{page}");
    assert_eq!(server.get("/avatar-0.ghand").1, std::fs::read(demo()).unwrap());
    let dist = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/dist");
    for (name, kind) in [("ghand-avatar.js", "text/javascript"), ("ghand.wasm", "application/wasm")] {
        let (head, body) = server.get(&format!("/{name}"));
        assert!(head.contains(kind) && body == std::fs::read(dist.join(name)).unwrap(), "{head}");
    }
}

#[test]
fn what_is_not_for_it_is_refused() {
    let server = serve(&[]);
    let status = |request: &str| server.ask(request).0.lines().next().unwrap().to_owned();
    assert_eq!(status("GET /../Cargo.toml HTTP/1.1\r\nHost: localhost\r\n\r\n"), "HTTP/1.1 404 Not Found");
    assert_eq!(status("POST / HTTP/1.1\r\nHost: localhost\r\n\r\n"), "HTTP/1.1 405 Method Not Allowed");
    assert_eq!(status("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), "HTTP/1.1 403 Forbidden");
    assert_eq!(status("GET / HTTP/1.1\r\n\r\n"), "HTTP/1.1 403 Forbidden");
    assert_eq!(status("nonsense\r\n\r\n"), "HTTP/1.1 400 Bad Request");
    assert_eq!(status(&format!("GET / HTTP/1.1\r\nX: {}\r\n\r\n", "x".repeat(20_000))), "HTTP/1.1 400 Bad Request");
    let (head, body) = server.ask("HEAD /ghand.wasm HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(head.starts_with("HTTP/1.1 200 OK") && body.is_empty(), "{head}");
    // One that says nothing does not keep others waiting.
    let silent = TcpStream::connect(("127.0.0.1", server.port)).unwrap();
    assert!(server.get("/").0.starts_with("HTTP/1.1 200 OK"));
    drop(silent);
}

#[test]
fn what_cannot_be_served_is_one_sentence() {
    let fails = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_ghand")).arg("serve").args(arguments).output().unwrap();
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(fails(&["none.ghand"]).contains("none.ghand"));
    assert!(fails(&[&demo(), "--motion", "cuont"]).contains("cuont"));
    let taken = serve(&[]);
    let port = taken.port.to_string();
    let error = fails(&[&demo(), "--port", &port]);
    assert!(error.contains("--port") && error.contains("choose another"), "{error}");
}
