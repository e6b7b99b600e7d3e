// Shows the picture of the view.
