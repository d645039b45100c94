"""Rock tie points, visual odometry, bundle adjustment."""
