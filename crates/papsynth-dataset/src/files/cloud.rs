//! Data sets in object stores: Amazon S3 and compatible stores (`s3://bucket/prefix`), Google Cloud Storage
//! (`gs://bucket/prefix`), Azure Blob Storage (`az://container/prefix`).
//!
//! Each file of a data set is one object. The record of a shard is uploaded after the files that it lists. Transient
//! failures are retried for three minutes.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use futures_util::TryStreamExt;
use object_store::path::Path as Key;
use object_store::{Error as StoreError, ObjectStore, ObjectStoreExt, ObjectStoreScheme, PutPayload, WriteMultipart};
use tokio::runtime::Runtime;
use url::Url;

use super::store::Store;
use crate::error::Error;

/// Larger files are uploaded in parts of this size.
const PART_BYTES: usize = 16 << 20;

/// A prefix in a bucket that contains the files of one data set.
#[derive(Debug)]
pub struct Bucket {
    url: String,
    store: Box<dyn ObjectStore>,
    /// The key of the folder of the data set.
    folder: Key,
    runtime: Runtime,
}

impl Bucket {
    /// Opens an address such as `s3://bucket/prefix`, with credentials and endpoint from the environment. Sends no
    /// request.
    ///
    /// # Errors
    /// If the address is invalid, the environment lacks settings of the store, or the system clock is before 1970.
    pub fn open(address: &str) -> Result<Self, Error> {
        if before_1970() {
            return Err(Error::folder(Path::new(address), "the system clock is before 1970; set the date"));
        }
        let wrong = |message: String| Error::Folder { path: PathBuf::from(address), message };
        let expected = "expected s3://bucket/prefix, gs://bucket/prefix or az://container/prefix";
        let url = Url::parse(address).map_err(|e| wrong(format!("invalid address ({e}); {expected}")))?;
        if url.query().is_some() || url.fragment().is_some() || !url.username().is_empty() || url.password().is_some() {
            return Err(wrong(format!(
                "credentials, query or fragment in the address; {expected}, with credentials in the environment"
            )));
        }
        let own = match ObjectStoreScheme::parse(&url) {
            Ok((ObjectStoreScheme::AmazonS3, _)) => "aws_",
            Ok((ObjectStoreScheme::GoogleCloudStorage, _)) => "google_",
            Ok((ObjectStoreScheme::MicrosoftAzure, _)) => "azure_",
            _ => return Err(wrong(format!("unsupported object store; {expected}"))),
        };
        // Only the first call in a process has an effect.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let variables = std::env::vars_os().filter_map(|(name, value)| {
            let (name, value) = (name.into_string().ok()?.to_ascii_lowercase(), value.into_string().ok()?);
            name.starts_with(own).then_some((name, value))
        });
        let (store, folder) = object_store::parse_url_opts(&url, variables).map_err(|e| wrong(e.to_string()))?;
        if folder.as_ref().is_empty() {
            return Err(wrong(format!("the prefix is missing; {expected}")));
        }
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|source| Error::Io { action: "read", path: PathBuf::from(address), source })?;
        Ok(Self { url: address.trim_end_matches('/').to_owned(), store, folder, runtime })
    }

    fn key(&self, name: &str) -> io::Result<Key> {
        Key::parse(format!("{}/{name}", self.folder)).map_err(|e| io::Error::new(io::ErrorKind::InvalidInput, e))
    }

    async fn put_parts(&self, key: &Key, file: &mut File) -> io::Result<()> {
        let upload = self.store.put_multipart(key).await.map_err(failed)?;
        let mut upload = WriteMultipart::new_with_chunk_size(upload, PART_BYTES);
        loop {
            let mut part = Vec::with_capacity(PART_BYTES);
            file.take(PART_BYTES as u64).read_to_end(&mut part)?;
            if part.is_empty() {
                break;
            }
            // Two parts in flight and one being read bound the memory.
            upload.wait_for_capacity(2).await.map_err(failed)?;
            upload.put(part.into());
        }
        upload.finish().await.map(drop).map_err(failed)
    }
}

impl Store for Bucket {
    fn url(&self) -> String {
        self.url.clone()
    }

    fn size(&self, name: &str) -> io::Result<Option<u64>> {
        let key = self.key(name)?;
        found(self.runtime.block_on(self.store.head(&key)).map(|found| found.size))
    }

    fn get(&self, name: &str, to: &Path) -> io::Result<bool> {
        let key = self.key(name)?;
        // The copy gets its name when it is complete.
        let unique = RandomState::new().hash_one(to);
        let partial = to.with_extension(format!("{unique:016x}.tmp"));
        let copied = self.runtime.block_on(async {
            let Some(object) = found(self.store.get(&key).await)? else { return Ok(false) };
            let mut file = File::create(&partial)?;
            let mut pieces = object.into_stream();
            while let Some(piece) = pieces.try_next().await.map_err(failed)? {
                file.write_all(&piece)?;
            }
            Ok(true)
        });
        match copied {
            Ok(true) => fs::rename(&partial, to).map(|()| true),
            Ok(false) => Ok(false),
            Err(error) => {
                // A file that cannot be removed stays in the folder for temporary files.
                let _ = fs::remove_file(&partial);
                Err(error)
            }
        }
    }

    fn put(&self, name: &str, from: &Path) -> io::Result<()> {
        let key = self.key(name)?;
        let mut file = File::open(from)?;
        if file.metadata()?.len() > PART_BYTES as u64 {
            return self.runtime.block_on(self.put_parts(&key, &mut file));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        self.runtime.block_on(self.store.put(&key, PutPayload::from(bytes))).map(drop).map_err(failed)
    }

    fn remove(&self, name: &str) -> io::Result<()> {
        let key = self.key(name)?;
        found(self.runtime.block_on(self.store.delete(&key))).map(drop)
    }

    fn list(&self, folder: &str) -> io::Result<BTreeMap<String, u64>> {
        let below = if folder.is_empty() { self.folder.clone() } else { self.key(folder)? };
        let prefix = format!("{}/", self.folder);
        self.runtime.block_on(async {
            let mut found = BTreeMap::new();
            let mut pages = self.store.list(Some(&below));
            while let Some(object) = pages.try_next().await.map_err(failed)? {
                if let Some(name) = object.location.as_ref().strip_prefix(&prefix) {
                    found.insert(name.to_owned(), object.size);
                }
            }
            Ok(found)
        })
    }
}

#[expect(clippy::disallowed_methods, reason = "signing requests panics on such a clock; it reaches no image")]
fn before_1970() -> bool {
    SystemTime::now() < SystemTime::UNIX_EPOCH
}

fn failed(error: StoreError) -> io::Error {
    io::Error::other(error)
}

/// Turns "not found" into `None`.
fn found<T>(found: Result<T, StoreError>) -> io::Result<Option<T>> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(StoreError::NotFound { .. }) => Ok(None),
        Err(error) => Err(failed(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_addresses_are_refused_with_the_expected_form() {
        for address in
            ["ftp://host/a", "s3:///a", "s3://bucket", "s3://bucket/", "s3://key:secret@bucket/a", "s3://bucket/a?b=c"]
        {
            let error = Bucket::open(address).unwrap_err();
            assert!(!error.is_io() && error.to_string().contains("s3://bucket/prefix"), "{error}");
        }
    }

    #[test]
    fn opening_an_address_sends_no_request() {
        let bucket = Bucket::open("s3://bucket/some/prefix/").unwrap();
        assert_eq!(bucket.url(), "s3://bucket/some/prefix");
        assert_eq!(bucket.key("shards/000000.json").unwrap().as_ref(), "some/prefix/shards/000000.json");
        assert!(bucket.key("../other").is_err());
    }
}
