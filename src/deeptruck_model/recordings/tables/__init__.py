"""Tables: CSV, Parquet and MAT files read, their columns and clocks named, and recordings written as one."""
