//! As much of HTTP/1.1 as the page needs: requests with short bodies, one after the other on a connection.

use std::io::{self, BufRead, Read, Write};

/// Longest head of a request in bytes.
const HEAD: u64 = 16 << 10;
/// Longest body of a request in bytes.
const BODY: usize = 64 << 10;

/// An HTTP request of a page.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// `GET`, `POST` and so on.
    pub method: String,
    /// Path, without the query.
    pub path: String,
    /// What follows the question mark; empty if there is none.
    pub query: String,
    /// Host that the browser names in its request.
    pub host: String,
    /// Body of the request, at most 64 KiB.
    pub body: Vec<u8>,
    /// Whether the connection ends after the answer.
    pub close: bool,
}

impl Request {
    /// Reads the next request. `None` at the end of the connection.
    ///
    /// # Errors
    /// `InvalidData` for what is no request, or a longer one than is allowed; errors of the connection.
    pub fn read(stream: &mut impl BufRead) -> io::Result<Option<Self>> {
        let mut head = stream.take(HEAD);
        let mut line = String::new();
        if head.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let mut words = line.split_ascii_whitespace();
        let (Some(method), Some(target), Some(version)) =
            (words.next(), words.next(), words.next())
        else {
            return Err(invalid());
        };
        if !version.starts_with("HTTP/1.") {
            return Err(invalid());
        }
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let mut request = Self {
            method: method.to_owned(),
            path: path.to_owned(),
            query: query.to_owned(),
            close: version == "HTTP/1.0",
            ..Self::default()
        };
        let mut length = 0;
        loop {
            let mut line = String::new();
            if head.read_line(&mut line)? == 0 {
                return Err(invalid());
            }
            let line = line.trim_end();
            if line.is_empty() {
                break;
            }
            let (name, value) = line.split_once(':').ok_or_else(invalid)?;
            let value = value.trim();
            match name.to_ascii_lowercase().as_str() {
                "host" => request.host = value.to_owned(),
                "content-length" => length = value.parse().map_err(|_| invalid())?,
                "connection" => request.close |= value.eq_ignore_ascii_case("close"),
                "transfer-encoding" => return Err(invalid()),
                _ => {}
            }
        }
        if length > BODY {
            return Err(invalid());
        }
        request.body.resize(length, 0);
        stream.read_exact(&mut request.body)?;
        Ok(Some(request))
    }

    /// Value of a name in the query.
    pub fn value(&self, name: &str) -> Option<&str> {
        let mut pairs = self
            .query
            .split('&')
            .filter_map(|pair| pair.split_once('='));
        pairs.find_map(|(found, value)| (found == name).then_some(value))
    }
}

fn invalid() -> io::Error {
    io::ErrorKind::InvalidData.into()
}

/// Headers of every answer. The page may load nothing but itself, and is never kept.
const ALWAYS: &str = "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
    Cross-Origin-Resource-Policy: same-origin\r\nX-Frame-Options: DENY\r\n\
    Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
    connect-src 'self'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n";

/// Answers with a body.
///
/// # Errors
/// Errors of the connection.
pub fn answer(
    stream: &mut impl Write,
    status: &str,
    kind: &str,
    more: &str,
    body: &[u8],
) -> io::Result<()> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{ALWAYS}{more}\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

/// Begins an answer that ends with the connection.
///
/// # Errors
/// Errors of the connection.
pub fn begin_stream(stream: &mut impl Write) -> io::Result<()> {
    let head = format!(
        "HTTP/1.1 200 OK\r\nContent-Type: application/octet-stream\r\nConnection: close\r\n{ALWAYS}\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> io::Result<Option<Request>> {
        Request::read(&mut text.as_bytes())
    }

    #[test]
    fn requests_are_read_one_after_the_other() {
        let text = "POST /a/b?ev=1.5&x=2 HTTP/1.1\r\nHOST: 127.0.0.1:80\r\ncontent-length: 3\r\n\r\nabcGET / HTTP/1.0\r\n\r\n";
        let mut stream = text.as_bytes();
        let first = Request::read(&mut stream)
            .expect("valid")
            .expect("a request");
        assert_eq!((&first.method[..], &first.path[..]), ("POST", "/a/b"));
        assert_eq!(
            (&first.host[..], &first.body[..]),
            ("127.0.0.1:80", &b"abc"[..])
        );
        assert_eq!(first.value("ev"), Some("1.5"));
        assert_eq!(first.value("x"), Some("2"));
        assert_eq!(first.value("y"), None);
        assert!(!first.close);
        let second = Request::read(&mut stream).expect("valid");
        assert!(second.is_some_and(|request| request.close && request.path == "/"));
        assert_eq!(Request::read(&mut stream).expect("the end"), None);
    }

    #[test]
    fn what_is_no_request_is_refused() {
        let long = format!("GET / HTTP/1.1\r\nX: {}\r\n\r\n", "x".repeat(HEAD as usize));
        for bad in [
            "\r\n",
            "GET /\r\n\r\n",
            "GET / HTTP/2\r\n\r\n",
            "GET / HTTP/1.1\r\n",
            "GET / HTTP/1.1\r\nno colon\r\n\r\n",
            "GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
            "GET / HTTP/1.1\r\nContent-Length: 65537\r\n\r\n",
            "GET / HTTP/1.1\r\nContent-Length: 5\r\n\r\nabc",
            "GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n",
            &long,
        ] {
            assert!(read(bad).is_err(), "{bad:.60}");
        }
    }
}
