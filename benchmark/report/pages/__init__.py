"""What the pages of a report are made of: templates, style and scripts; they ask nobody for anything."""
