//! Whether a shard is whole.

use super::contents::{self, Flaw};
use super::manifest::Manifest;
use super::record::ShardRecord;
use super::set::{Dataset, read_record, recorded_shards};
use crate::error::Error;
use crate::files::Check;
use crate::formats::names;

impl Dataset {
    /// The record of a shard if it is whole: its record is there, is of this data set, and all its files are as it says.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn whole(&self, shard: u64, check: Check) -> Result<Option<ShardRecord>, Error> {
        let whole = self.whole_or_flaw(shard, check).map_err(|error| self.folder.named(error));
        Ok(whole?.ok())
    }

    /// The same, or what the shard lacks.
    pub(crate) fn whole_or_flaw(&self, shard: u64, check: Check) -> Result<Result<ShardRecord, Flaw>, Error> {
        let flaw = |message: String| Ok(Err(Flaw { path: names::record(shard), message }));
        let record = match read_record(&self.folder, shard) {
            Ok(record) => record,
            Err(Error::Input { problem, .. }) => return flaw(problem.to_string()),
            Err(failure) => return Err(failure),
        };
        if record.identity != self.identity || record.layout != self.layout {
            return flaw("is of another data set".to_owned());
        }
        for file in &record.files {
            if let Some(message) = self.folder.flaw(file, check)? {
                return Ok(Err(Flaw { path: file.path.clone(), message }));
            }
        }
        if check == Check::Hashes
            && let Some(flaw) = contents::flaw(self, &record)?
        {
            return Ok(Err(flaw));
        }
        Ok(Ok(record))
    }

    /// Whether [`finish`](Self::finish) has merged all frames that are recorded, and its files are still there.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn is_finished(&self) -> Result<bool, Error> {
        let manifest = Manifest::read(&self.folder)?;
        if manifest.frames == 0 || manifest.shards != recorded_shards(&self.folder)?.len() as u64 {
            return Ok(false);
        }
        for file in &manifest.files {
            if self.folder.flaw(file, Check::Sizes)?.is_some() {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
