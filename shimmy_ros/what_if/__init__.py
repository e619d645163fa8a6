"""What-if questions: queries and answers as text, worked out point by point, without ROS."""
