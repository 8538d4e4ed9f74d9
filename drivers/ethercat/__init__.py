"""An EtherCAT master on raw frames."""
