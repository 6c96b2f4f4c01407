"""Who carries the runs of a campaign out: processes of this machine, or of others by Dask."""
