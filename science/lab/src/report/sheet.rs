//! Rows as a spreadsheet.

use std::path::Path;

use antumbra_image::atomic_write;
use serde_json::Value;

use crate::Error;
use crate::study::Row;

/// Writes one line per row, with the names of its fields above; what is not known is empty. The parts of a time have
/// columns of their own.
pub fn write(rows: &[&Row], path: &Path) -> Result<(), Error> {
    let mut sheet = csv::Writer::from_writer(Vec::new());
    let lines: Result<Vec<Value>, _> = rows.iter().map(serde_json::to_value).collect();
    let lines = lines.map_err(Error::report)?;
    let mut names: Vec<&String> = Vec::new();
    for line in lines.iter().flat_map(Value::as_object) {
        if names.is_empty() {
            names.extend(line.keys());
            sheet.write_record(&names).map_err(Error::report)?;
        }
        let cells = names.iter().map(|name| text(&line[name.as_str()]));
        sheet.write_record(cells).map_err(Error::report)?;
    }
    let bytes = sheet.into_inner().map_err(Error::report)?;
    atomic_write(path, |file| file.write_all(&bytes))?;
    Ok(())
}

fn text(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Object(parts) => {
            let part = |(name, value): (&String, &Value)| format!("{name} {value}");
            parts.iter().map(part).collect::<Vec<_>>().join("; ")
        }
        other => other.to_string(),
    }
}
