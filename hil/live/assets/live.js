hilView.follow();
