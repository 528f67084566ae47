//! What notebooks show of objects.

/// A small table with a title. Texts of ours need no escapes; others go through [`escaped`].
pub fn table(title: &str, rows: &[(&str, String)]) -> String {
    let rows: String = rows
        .iter()
        .map(|(name, value)| {
            format!("<tr><th style=\"text-align:left\">{name}</th><td>{value}</td></tr>")
        })
        .collect();
    let title = escaped(title);
    format!("<table><caption><b>{title}</b></caption><tbody>{rows}</tbody></table>")
}

/// A text without signs that HTML reads.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// A share from 0 to 1 in percent.
pub fn percent(share: f64) -> String {
    match share.is_nan() {
        true => "0 %".to_owned(),
        false => format!("{:.1} %", 100.0 * share),
    }
}
