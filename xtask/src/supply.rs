//! What comes from others: a bill of materials, and whether `deny.toml` lets it in.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::workspace::Workspace;
use crate::{Chore, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "sbom",
    usage: "[--check]",
    about: "writes the bill of materials of the program, as CycloneDX, to the target folder",
    details: "CycloneDX 1.5 in JSON: every crate that `papsynth` is built of, on any platform, with version, licence, SHA-256 and what it depends on. The same \
              Cargo.lock gives the same bytes. With --check nothing is written: licences, sources and crates that are there twice are held against deny.toml.",
    run,
};

/// The crate whose program is shipped.
const PROGRAM: &str = "papsynth-cli";

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let check_alone = arguments.flag("--check");
    arguments.finish()?;
    if check_alone {
        return check(workspace);
    }
    println!("{}", workspace.shown(&write(workspace)?));
    Ok(Outcome::Done)
}

/// Writes the bill of materials and says where it lies.
pub(crate) fn write(workspace: &Workspace) -> Result<std::path::PathBuf> {
    let tree = Tree::load(workspace)?;
    let path = workspace.target.join("papsynth.cdx.json");
    fs::create_dir_all(&workspace.target)?;
    fs::write(&path, format!("{:#}\n", tree.bill()?)).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Licences and crates that are there twice must be those that `deny.toml` lists: what `cargo deny` says of them, without it.
pub(crate) fn check(workspace: &Workspace) -> Result<Outcome> {
    let text = fs::read_to_string(workspace.root.join("deny.toml")).context("deny.toml")?;
    let rules: toml::Table = text.parse().context("deny.toml")?;
    let list = |section: &str, key: &str| -> Result<Vec<toml::Value>> {
        let list = rules.get(section).and_then(|section| section.get(key)).and_then(toml::Value::as_array);
        list.cloned().with_context(|| format!("deny.toml has no list {section}.{key}"))
    };
    let allowed: BTreeSet<String> =
        list("licenses", "allow")?.iter().filter_map(|name| name.as_str().map(str::to_owned)).collect();
    let skipped: BTreeSet<String> = list("bans", "skip")?
        .iter()
        .filter_map(|entry| entry.get("crate").and_then(toml::Value::as_str).map(str::to_owned))
        .collect();
    let tree = Tree::load(workspace)?;
    let (mut wrong, mut twice) = (Vec::new(), Vec::new());
    let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in tree.used.iter().filter_map(|id| tree.packages.get(id)) {
        let (name, version) = (text_of(package, "name")?, text_of(package, "version")?);
        versions.entry(name).or_default().push(version);
        let is_ours = package.get("source").is_none_or(Value::is_null);
        match package.get("license").and_then(Value::as_str) {
            _ if is_ours => {}
            Some(licence) if is_allowed(licence, &allowed) => {}
            licence => wrong.push(format!("{name} {version} is under {}", licence.unwrap_or("no licence"))),
        }
        let source = package.get("source").and_then(Value::as_str).unwrap_or_default();
        if !is_ours && !source.starts_with("registry+") {
            wrong.push(format!("{name} {version} comes from {source}"));
        }
    }
    for (name, versions) in versions {
        // All but one of them are listed: `name@1`, or `name@0.1` as compatible versions begin.
        let is_listed = |version: &&&str| {
            skipped.iter().any(|entry| {
                entry.strip_prefix(name).and_then(|rest| rest.strip_prefix('@')).is_some_and(|listed| {
                    version.strip_prefix(listed).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
                })
            })
        };
        if versions.iter().filter(|version| !is_listed(version)).count() > 1 {
            twice.push(format!("{name} is there in versions {}", versions.join(", ")));
        }
    }
    // As `cargo deny` takes it: a warning, or an error.
    match rules.get("bans").and_then(|bans| bans.get("multiple-versions")).and_then(toml::Value::as_str) {
        Some("deny") => wrong.append(&mut twice),
        _ => twice.iter().for_each(|twice| println!("warning: {twice}")),
    }
    if !wrong.is_empty() {
        bail!("deny.toml does not allow: {}", wrong.join("; "));
    }
    println!("{} crates: licences and sources are those that deny.toml allows", tree.used.len());
    Ok(Outcome::Done)
}

/// Whether one of the licences that are offered is allowed, and all that are asked for together.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    // Of SPDX what crates use: names, AND before OR, parentheses, and a slash that once stood for OR.
    let spaced = expression.replace('/', " OR ").replace(" or ", " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut at = 0;
    let fits = either(&words, &mut at, allowed);
    fits && at == words.len()
}

fn either(words: &[&str], at: &mut usize, allowed: &BTreeSet<String>) -> bool {
    let mut fits = both(words, at, allowed);
    while words.get(*at) == Some(&"OR") {
        *at += 1;
        fits |= both(words, at, allowed);
    }
    fits
}

fn both(words: &[&str], at: &mut usize, allowed: &BTreeSet<String>) -> bool {
    let mut fits = one(words, at, allowed);
    while words.get(*at) == Some(&"AND") {
        *at += 1;
        fits &= one(words, at, allowed);
    }
    fits
}

fn one(words: &[&str], at: &mut usize, allowed: &BTreeSet<String>) -> bool {
    let word = words.get(*at);
    *at += 1;
    let Some(word) = word else { return false };
    if *word == "(" {
        let fits = either(words, at, allowed);
        *at += 1;
        return fits;
    }
    // An exception only takes conditions away.
    if words.get(*at) == Some(&"WITH") {
        *at += 2;
    }
    allowed.contains(*word)
}

/// All that Cargo has resolved.
struct Tree {
    /// What the workspace is built and tested with; Cargo lists more.
    used: BTreeSet<String>,
    /// By identity.
    packages: BTreeMap<String, Value>,
    /// What each is built of, tests and examples left out.
    built_of: BTreeMap<String, BTreeSet<String>>,
    /// SHA-256 by name and version, out of Cargo.lock.
    hashes: BTreeMap<(String, String), String>,
}

impl Tree {
    fn load(workspace: &Workspace) -> Result<Self> {
        let mut cargo = workspace.cargo();
        cargo.args(["metadata", "--format-version", "1", "--locked", "--all-features"]);
        let metadata: Value =
            serde_json::from_str(&shell::output(&mut cargo)?).context("the output of `cargo metadata`")?;
        let array = |value: &Value, key: &str| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
        let mut packages = BTreeMap::new();
        for package in array(&metadata, "packages") {
            packages.insert(text_of(&package, "id")?.to_owned(), package);
        }
        let (mut built_of, mut needs) = (BTreeMap::new(), BTreeMap::new());
        for node in array(metadata.get("resolve").unwrap_or(&Value::Null), "nodes") {
            let is_built = |dep: &&Value| {
                array(dep, "dep_kinds").iter().any(|kind| kind.get("kind").and_then(Value::as_str) != Some("dev"))
            };
            let needed = array(&node, "deps");
            let ids = needed.iter().map(|dep| Ok(text_of(dep, "pkg")?.to_owned())).collect::<Result<Vec<_>>>()?;
            needs.insert(text_of(&node, "id")?.to_owned(), ids);
            let needed = needed.iter().filter(is_built).map(|dep| Ok(text_of(dep, "pkg")?.to_owned()));
            built_of.insert(text_of(&node, "id")?.to_owned(), needed.collect::<Result<BTreeSet<_>>>()?);
        }
        let (mut used, mut open) = (BTreeSet::new(), Vec::new());
        open.extend(array(&metadata, "workspace_members").iter().filter_map(Value::as_str).map(str::to_owned));
        while let Some(id) = open.pop() {
            if used.insert(id.clone()) {
                open.extend(needs.get(&id).into_iter().flatten().cloned());
            }
        }
        let lock = fs::read_to_string(workspace.root.join("Cargo.lock")).context("Cargo.lock")?;
        let lock: toml::Table = lock.parse().context("Cargo.lock")?;
        let mut hashes = BTreeMap::new();
        for package in lock.get("package").and_then(toml::Value::as_array).into_iter().flatten() {
            let word = |key: &str| package.get(key).and_then(toml::Value::as_str).map(str::to_owned);
            if let (Some(name), Some(version), Some(hash)) = (word("name"), word("version"), word("checksum")) {
                hashes.insert((name, version), hash);
            }
        }
        Ok(Self { used, packages, built_of, hashes })
    }

    /// CycloneDX 1.5: <https://cyclonedx.org/docs/1.5/json/>. No date and no serial number, which would differ from run to run.
    fn bill(&self) -> Result<Value> {
        let program = self.packages.iter().find(|(_, package)| package.get("name") == Some(&json!(PROGRAM)));
        let (root, program) = program.with_context(|| format!("there is no crate `{PROGRAM}`"))?;
        let mut needed = BTreeSet::new();
        let mut open = vec![root.as_str()];
        while let Some(id) = open.pop() {
            if needed.insert(id) {
                open.extend(self.built_of.get(id).into_iter().flatten().map(String::as_str));
            }
        }
        let mut components = BTreeMap::new();
        let mut dependencies = BTreeMap::new();
        for id in needed {
            let package =
                self.packages.get(id).with_context(|| format!("Cargo resolves to `{id}`, which it does not list"))?;
            let purl = purl(package)?;
            let below = self.built_of.get(id).into_iter().flatten().filter_map(|id| self.packages.get(id));
            let below = below.map(self::purl).collect::<Result<BTreeSet<_>>>()?;
            dependencies.insert(purl.clone(), json!({ "ref": purl, "dependsOn": below }));
            if id != root {
                components.insert(purl, self.component(package, "library")?);
            }
        }
        ensure!(!components.is_empty(), "`{PROGRAM}` is built of nothing");
        Ok(json!({
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": { "component": self.component(program, "application")? },
            "components": components.into_values().collect::<Vec<_>>(),
            "dependencies": dependencies.into_values().collect::<Vec<_>>(),
        }))
    }

    fn component(&self, package: &Value, kind: &str) -> Result<Value> {
        let (name, version, purl) = (text_of(package, "name")?, text_of(package, "version")?, purl(package)?);
        let mut component = json!({ "type": kind, "bom-ref": purl, "name": name, "version": version, "purl": purl });
        if let Some(licence) = package.get("license").and_then(Value::as_str) {
            component["licenses"] = json!([{ "expression": licence.replace('/', " OR ") }]);
        }
        if let Some(hash) = self.hashes.get(&(name.to_owned(), version.to_owned())) {
            component["hashes"] = json!([{ "alg": "SHA-256", "content": hash }]);
        }
        Ok(component)
    }
}

fn purl(package: &Value) -> Result<String> {
    Ok(format!("pkg:cargo/{}@{}", text_of(package, "name")?, text_of(package, "version")?))
}

fn text_of<'v>(value: &'v Value, key: &str) -> Result<&'v str> {
    value.get(key).and_then(Value::as_str).with_context(|| format!("Cargo's metadata have no `{key}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_what_is_offered_and_all_of_what_is_asked_for() {
        let allowed = ["MIT", "Apache-2.0", "Unicode-3.0"].map(str::to_owned).into();
        for good in [
            "MIT",
            "MIT/GPL-3.0",
            "GPL-2.0 OR MIT",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "Apache-2.0 WITH LLVM-exception",
        ] {
            assert!(is_allowed(good, &allowed), "{good}");
        }
        for bad in ["", "GPL-3.0", "MIT AND GPL-3.0", "(GPL-2.0 OR MPL-2.0) AND MIT", "MIT OR", "MIT )", "MITX"] {
            assert!(!is_allowed(bad, &allowed), "{bad}");
        }
    }
}
