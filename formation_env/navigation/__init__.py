"""Settings of the sensor and of the Kalman filter."""
