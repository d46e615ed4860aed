"""From a town, its actors and the weather to pictures, LiDAR and views from above."""
