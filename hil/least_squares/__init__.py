"""Linear regression of joint torques: terms, low-pass, solution; for planning and estimation."""
