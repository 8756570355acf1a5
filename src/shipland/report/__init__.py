"""Pictures of flights and campaigns: video, overlay, plots, summaries."""
